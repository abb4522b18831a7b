"""Results of rulers and straight-line fits on the measured logs, independent of any diagnosis."""

import numpy as np
import numpy.typing as npt
import scipy.io
from scipy.signal import find_peaks, savgol_filter

from tests.real.evidences import AXIS, SLIDER

Floats = npt.NDArray[np.float64]
_MASS_KG, _GRAVITY_MPS2 = 0.0307, 9.81
_LOGS = {  # drive velocity [m/s], stiffness [N/m]
    "k168Nm_v42": (4.2e-5, 168.0),
    "k168Nm_v1100": (1.1e-3, 168.0),
    "k168Nm_v4300": (4.3e-3, 168.0),
    "k1002Nm_v1100": (1.1e-3, 1002.0),
    "k2254Nm_v42": (4.2e-5, 2254.0),
}
_WAVES_M = np.linspace(0.002, 0.007, 251)
_DROP = 0.015  # of the weight: a smaller fall is not a slip


def known() -> list[str]:
    """One line a log."""
    return [*(_slider(name, *numbers) for name, numbers in _LOGS.items()), *_axis()]


def _slider(name: str, velocity_mps: float, stiffness_N_per_m: float) -> str:
    log = scipy.io.loadmat(SLIDER / f"{name}.mat")
    t_s, force = log["t"].ravel(), log["Fnorm"].ravel()
    rate_Hz = (len(t_s) - 1) / (t_s[-1] - t_s[0])
    smooth = np.convolve(force, np.full(4, 0.25), mode="same")[4:-4]
    peaks, about = find_peaks(smooth, prominence=_DROP)
    x_m = velocity_mps * t_s[4:-4] - smooth * _MASS_KG * _GRAVITY_MPS2 / stiffness_N_per_m
    period_m, ratio, share = _wave(x_m[peaks], smooth[peaks])
    spectrum = 4.0 * np.abs(np.fft.rfft((force - force.mean()) * np.hanning(len(force)))) / len(force)
    near = np.abs(np.fft.rfftfreq(len(force), 1.0 / rate_Hz) - 50.0) < 0.5
    fall_s = np.median(about["right_bases"] - peaks) / rate_Hz if len(peaks) else np.nan
    half_period_s = np.pi * np.sqrt(_MASS_KG / stiffness_N_per_m)
    return (
        f"{name}: {len(peaks)} peaks, mean {smooth[peaks].mean():.3f} of the weight; a wave of {1e3 * period_m:.2f} mm, "
        f"{100 * ratio:.0f} % of the force, takes {100 * share:.0f} % of their variance; "
        f"falls last {1e3 * fall_s:.0f} ms, pi sqrt(m/k) {1e3 * half_period_s:.0f} ms; "
        f"50 Hz {1e3 * spectrum[near].max():.2f} and noise {1e3 * np.diff(force).std() / 2**0.5:.1f} thousandths of the weight"
    )


def _wave(at_m: Floats, value: Floats) -> tuple[float, float, float]:
    """Period [m], amplitude relative to the mean, and share of the variance of the best sine, free of a straight line."""
    left = value - np.polyval(np.polyfit(at_m, value, 1), at_m)
    best = (np.nan, np.nan, -1.0)
    for period_m in _WAVES_M:
        columns = np.stack([np.sin(2 * np.pi * at_m / period_m), np.cos(2 * np.pi * at_m / period_m)], axis=1)
        sizes, *_ = np.linalg.lstsq(columns, left, rcond=None)
        share = 1.0 - float(np.var(left - columns @ sizes) / np.var(left))
        if share > best[2]:
            best = (float(period_m), float(np.hypot(*sizes) / value.mean()), share)
    return best


def _axis() -> list[str]:
    """The published regression again, and the part of its residual that further terms explain."""
    log = scipy.io.loadmat(AXIS / "DATA_EMPS.mat")
    q_m, force_N = log["qm"].ravel(), float(log["gtau"].item()) * log["vir"].ravel()
    v, a = (savgol_filter(q_m, 61, 3, order, delta=1e-3) for order in (1, 2))
    moving = np.abs(v) > 0.005  # m/s: away from the reversals
    right = savgol_filter(force_N, 61, 3)[moving]
    q_m, v, a = q_m[moving], v[moving], a[moving]
    lines: list[str] = []
    columns: list[Floats] = []
    for name, more in (
        ("mass, viscous, Coulomb", [a, v, np.sign(v)]),
        ("offset", [np.ones_like(v)]),
        ("other viscous friction one way", [np.abs(v)]),
        ("bend over the speed", [v * np.abs(v), np.sign(v) * np.abs(v) ** 0.5]),
    ):
        columns += more
        design = np.stack(columns, axis=1)
        sizes, *_ = np.linalg.lstsq(design, right, rcond=None)
        left_N = float(np.sqrt(np.mean((right - design @ sizes) ** 2)))
        numbers = ", ".join(f"{size:.4g}" for size in sizes[-len(more) :])
        lines.append(f"axis: {name} ({numbers}): leaves {left_N:.2f} N rms")
    left = right - design @ sizes
    waves: list[tuple[float, float, float]] = []
    for period_m in np.geomspace(0.002, 0.02, 400):
        pair = np.stack([np.sin(2 * np.pi * q_m / period_m), np.cos(2 * np.pi * q_m / period_m)], axis=1)
        sizes, *_ = np.linalg.lstsq(pair, left, rcond=None)
        waves.append((float(np.sqrt(np.mean((left - pair @ sizes) ** 2))), period_m, float(np.hypot(*sizes))))
    left_N, period_m, ripple_N = min(waves)
    return [*lines, f"axis: ripple over {1e3 * period_m:.2f} mm ({ripple_N:.2g}): leaves {left_N:.2f} N rms"]
