"""Friction effects of the library."""

import numpy as np
from scipy.signal import butter, sosfiltfilt

from tests.blind.generator.effect import Formula, Numbers, either, noise_of, noise_seed
from tests.blind.generator.kernel import SAMPLE_RATE_HZ
from tests.blind.generator.runs import Tracks

Random = np.random.Generator


def _ageing(p: np.ndarray, s: float, n: Numbers) -> None:
    for name in ("ageing_exponent", "ageing_fast_s", "ageing_slow_s", "ageing_reset_m"):
        p[name] = n[name]
    p["ageing"] = s * n["growth"]


def _lag(p: np.ndarray, s: float, n: Numbers) -> None:
    """Time or distance are in proportion to the strength; below a strength of 0.1 the share that lags fades as well.

    Otherwise the faintest lag would still act under vibration, with its period of 0.2 ms and its path of 0.08 um.
    """
    p["lag_share"] = 1.1 * s / (s + 0.1) if s < 1.0 else 1.0
    p["lag_delay_s"] = s * n["delay_s"]
    p["lag_distance_m"] = s * n["distance_m"]


def _viscous(p: np.ndarray, s: float, n: Numbers) -> None:
    p["viscous_damping_Ns_per_m"] += s * n["linear_Ns_per_m"]
    p["quadratic_damping_Ns2_per_m2"] += s * n["quadratic_Ns2_per_m2"]


def _waves(x_m: np.ndarray, level: np.ndarray, s: float, n: Numbers) -> None:
    for i in range(3):
        level += s * n[f"depth_{i}"] * np.sin(2.0 * np.pi * x_m / n[f"length_{i}_m"] + n[f"phase_{i}_rad"])


def _draw_waves(random: Random) -> dict[str, float]:
    depth = random.uniform(0.05, 0.09)
    lengths = np.exp(random.uniform(np.log(0.8e-3), np.log(5e-3), 3))
    shares = (0.7, 0.45, random.choice((0.0, 0.3)))  # two or three components
    return {
        **{f"depth_{i}": depth * share for i, share in enumerate(shares)},
        **{f"length_{i}_m": length for i, length in enumerate(lengths)},
        **{f"phase_{i}_rad": phase for i, phase in enumerate(random.uniform(0.0, 2.0 * np.pi, 3))},
    }


def _bumps(x_m: np.ndarray, level: np.ndarray, s: float, n: Numbers) -> None:
    turn = (x_m / n["pitch_m"] + n["phase"]) % 1.0 - 0.5
    level += s * n["height"] * np.exp(-0.5 * (turn / n["width"]) ** 2)


def _direction(p: np.ndarray, s: float, n: Numbers) -> None:
    p["direction_coulomb"] = s * n["coulomb"]
    p["direction_static"] = s * n["static"]


def _draw_direction(random: Random) -> dict[str, float]:
    size = either(random) * random.uniform(0.05, 0.08)
    return {"coulomb": size, "static": size if random.random() < 0.5 else 0.0}


def _load_wave(tracks: Tracks, s: float, n: Numbers) -> None:
    angle = 2.0 * np.pi * n["frequency_Hz"] * tracks.t_s + n["phase_rad"] + tracks.number * 2.4
    tracks.load += s * n["depth"] * (np.sin(angle) + n["harmonic"] * np.sin(2.0 * angle + n["phase_2_rad"]))


def _load_noise(tracks: Tracks, s: float, n: Numbers) -> None:
    band = n["frequency_Hz"] * np.array([1.0 - n["half_band"], 1.0 + n["half_band"]])
    slow = SAMPLE_RATE_HZ // 100  # filtered at 200 Hz, as a filter of so narrow a band is ill-conditioned at 20 kHz
    coarse = noise_of(n, tracks.number).standard_normal(len(tracks.t_s) // slow + 4000)
    coarse = sosfiltfilt(butter(2, band, "bandpass", fs=200.0, output="sos"), coarse)[2000:]
    noise = np.interp(tracks.t_s * 200.0, np.arange(len(coarse)), coarse / coarse.std())
    tracks.load += s * n["depth"] * np.clip(noise, -3.0, 3.0) / np.sqrt(2.0)


def _run_in(tracks: Tracks, s: float, n: Numbers) -> None:
    session_s = 10.0 * tracks.number + tracks.t_s  # surfaces stay run in from one run to the next
    tracks.load *= 1.0 + s * n["change"] * (1.0 - np.exp(-session_s / n["time_s"]))


def _warm_up(tracks: Tracks, s: float, n: Numbers) -> None:
    tracks.load *= 1.0 + s * n["change"] * np.sqrt(tracks.t_s / 10.0)  # heat into a half space; cold at each start


def _level(key: str):
    def rig(p: np.ndarray, s: float, n: Numbers) -> None:
        p[key] *= np.exp(s * n["log_change"])  # below 0 for no strength
        if key == "coulomb_force_N":  # a contact never slides harder than it breaks away
            p[key] = np.minimum(p[key], p["static_force_N"] / 1.005)

    return rig


def _static_level(p: np.ndarray, s: float, n: Numbers) -> None:
    changed = p["static_force_N"] * np.exp(s * n["log_change"])
    p["static_force_N"] = np.maximum(changed, 1.005 * p["coulomb_force_N"])


FORMULAS = (
    # Dieterich 1972, Bureau et al. 2002: F_s grows as a power, or on two time scales, and sliding wears it off
    Formula(
        "static-friction-ageing",
        "power-law",
        lambda r: {
            "growth": r.uniform(0.06, 0.09),
            "ageing_exponent": r.uniform(0.2, 0.35),
            "ageing_fast_s": 1.0,
            "ageing_slow_s": 1.0,
            "ageing_reset_m": r.uniform(3e-6, 8e-6),
        },
        rig=_ageing,
    ),
    Formula(
        "static-friction-ageing",
        "two-times",
        lambda r: {
            "growth": r.uniform(0.05, 0.08),
            "ageing_exponent": 0.0,
            "ageing_fast_s": r.uniform(0.2, 0.5),
            "ageing_slow_s": r.uniform(2.0, 5.0),
            "ageing_reset_m": r.uniform(3e-6, 8e-6),
        },
        rig=_ageing,
    ),
    # Hess & Soom 1990: a pure delay of the Stribeck curve; Rabinowicz: a sliding distance
    Formula("frictional-lag", "delay", lambda r: {"delay_s": r.uniform(4e-3, 8e-3), "distance_m": 0.0}, rig=_lag),
    Formula("frictional-lag", "distance", lambda r: {"delay_s": 0.0, "distance_m": r.uniform(30e-6, 80e-6)}, rig=_lag),
    Formula(
        "viscous-friction",
        "linear-and-square",
        lambda r: {"linear_Ns_per_m": r.uniform(40.0, 80.0), "quadratic_Ns2_per_m2": r.uniform(1000.0, 4000.0)},
        rig=_viscous,
    ),
    Formula("position-dependent-friction", "waves", _draw_waves, surface=_waves),
    Formula(
        "position-dependent-friction",
        "bumps",
        lambda r: {
            "height": either(r) * r.uniform(0.10, 0.15),
            "pitch_m": r.uniform(1.2e-3, 4e-3),
            "width": r.uniform(0.08, 0.2),
            "phase": r.uniform(0.0, 1.0),
        },
        surface=_bumps,
    ),
    Formula("direction-dependent-friction", "both-or-coulomb", _draw_direction, rig=_direction),
    Formula(
        "normal-load-fluctuation",
        "wave-with-harmonic",
        lambda r: {
            "depth": r.uniform(0.06, 0.09),
            "frequency_Hz": float(np.exp(r.uniform(np.log(0.4), np.log(8.0)))),
            "harmonic": r.uniform(0.2, 0.5),
            "phase_rad": r.uniform(0.0, 2.0 * np.pi),
            "phase_2_rad": r.uniform(0.0, 2.0 * np.pi),
        },
        run=_load_wave,
    ),
    Formula(
        "normal-load-fluctuation",
        "narrow-band",
        lambda r: {
            "depth": r.uniform(0.07, 0.10),
            "frequency_Hz": float(np.exp(r.uniform(np.log(0.8), np.log(8.0)))),
            "half_band": r.uniform(0.1, 0.25),
            "seed": noise_seed(r),
        },
        run=_load_noise,
    ),
    Formula(
        "friction-drift",
        "run-in",
        lambda r: {"change": either(r) * r.uniform(0.12, 0.18), "time_s": r.uniform(6.0, 15.0)},
        run=_run_in,
    ),
    Formula("friction-drift", "warm-up", lambda r: {"change": either(r) * r.uniform(0.10, 0.16)}, run=_warm_up),
    # 3 % of F_c is one standard deviation: these are 5 to 7 of them; F_c stays below F_s, F_s above F_c
    Formula(
        "coulomb-level",
        "log-shift",
        lambda r: {"log_change": r.choice((-r.uniform(0.15, 0.22), r.uniform(0.10, 0.14)))},
        rig=_level("coulomb_force_N"),
    ),
    Formula(
        "static-level",
        "log-shift",
        lambda r: {"log_change": r.choice((-r.uniform(0.10, 0.13), r.uniform(0.15, 0.22)))},
        rig=_static_level,
    ),
    Formula(
        "stribeck-velocity",
        "log-shift",
        lambda r: {"log_change": r.choice((-r.uniform(0.7, 1.1), r.uniform(0.6, 1.0)))},
        rig=_level("stribeck_velocity_mps"),
    ),
)
