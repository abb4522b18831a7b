"""Drive, structure and piezo effects of the library."""

import numpy as np

from tests.blind.generator.effect import Formula, Numbers, either, scales
from tests.blind.generator.runs import AMPLITUDE_m, Tracks

Random = np.random.Generator
SCREW_PITCH_m = (0.5e-3, 1e-3, 2e-3)


def _kelvin_voigt(p: np.ndarray, s: float, n: Numbers) -> None:
    p["drive_damping_Ns_per_m"] += s * n["damping_Ns_per_m"]


def _maxwell(p: np.ndarray, s: float, n: Numbers) -> None:
    p["maxwell_time_s"] = n["time_s"]
    p["maxwell_stiffness_N_per_m"] = s * n["damping_Ns_per_m"] / n["time_s"]


def _stiffness(p: np.ndarray, s: float, n: Numbers) -> None:
    p["drive_stiffness_N_per_m"] *= np.exp(s * n["log_change"])


def _move_drive(tracks: Tracks, extra_m: np.ndarray) -> None:
    """Move the drive itself, so that its displacement sensor shows the motion."""
    extra_m = extra_m - extra_m[0]
    tracks.drive_m += extra_m
    tracks.drive_mps += np.gradient(extra_m, tracks.t_s)


def _wave(angle: np.ndarray, n: Numbers) -> np.ndarray:
    return np.sin(angle + n["phase_rad"]) + n["harmonic"] * np.sin(2.0 * angle + n["phase_2_rad"])


def _ripple_pitch(tracks: Tracks, s: float, n: Numbers) -> None:
    """The lead of the screw has an error once and twice per turn; the angle at the start follows from the position."""
    per_m = 2.0 * np.pi / n["pitch_m"]
    _move_drive(tracks, s * n["depth"] / per_m * _wave(per_m * (tracks.origin_m + tracks.drive_m), n))


def _ripple_time(tracks: Tracks, s: float, n: Numbers) -> None:
    """The motor's speed swings around its command, by a share of the command."""
    speed = s * n["depth"] * tracks.drive_mps * _wave(2.0 * np.pi * n["frequency_Hz"] * tracks.t_s, n)
    _move_drive(tracks, np.cumsum(speed) * (tracks.t_s[1] - tracks.t_s[0]))


def _ripple_numbers(random: Random) -> dict[str, float]:
    return {
        "depth": random.uniform(0.25, 0.45),
        "harmonic": random.uniform(0.2, 0.5),
        "phase_rad": random.uniform(0.0, 2.0 * np.pi),
        "phase_2_rad": random.uniform(0.0, 2.0 * np.pi),
    }


def _structure(side: str):
    def rig(p: np.ndarray, s: float, n: Numbers) -> None:
        omega = 2.0 * np.pi * n["frequency_Hz"]
        p[f"{side}_omega_radps"] = omega
        p[f"{side}_damping_ratio"] = n["damping_ratio"]
        p[f"{side}_inverse_mass_1_per_kg"] = s * omega**2 / n["stiffness_N_per_m"]

    return rig


def _deliver(tracks: Tracks, response: np.ndarray) -> None:
    """Delivered over commanded vibration, (samples,) complex; the frequency is held while the amplitude is not 0."""
    tracks.amplitude_m[:-1] *= np.abs(response)
    tracks.amplitude_m[-1] *= np.abs(response[-1])
    tracks.phase_rad += np.angle(response)


def _roll_off_1(tracks: Tracks, s: float, n: Numbers) -> None:
    _deliver(tracks, 1.0 / (1.0 + 1j * s * tracks.frequency_Hz / n["corner_Hz"]))


def _roll_off_2(tracks: Tracks, s: float, n: Numbers) -> None:
    r = s * tracks.frequency_Hz / n["corner_Hz"]
    _deliver(tracks, 1.0 / (1.0 - r**2 + 2j * n["damping_ratio"] * r))


def _resonance(tracks: Tracks, s: float, n: Numbers) -> None:
    r = tracks.frequency_Hz / n["frequency_Hz"]
    _deliver(tracks, 1.0 + s * n["share"] * r**2 / (1.0 - r**2 + 2j * n["damping_ratio"] * r))


def _sag_heat(tracks: Tracks, s: float, n: Numbers) -> None:
    """Loss grows with the time driven, as the stack warms: power goes as amplitude squared times frequency."""
    step_s = tracks.t_s[1] - tracks.t_s[0]
    power = (tracks.commanded_m[:-1] / AMPLITUDE_m) ** 2 * tracks.frequency_Hz / 3000.0
    energy_s = np.concatenate(([0.0], np.cumsum(power) * step_s))
    tracks.amplitude_m /= 1.0 + s * n["loss"] * (1.0 - np.exp(-energy_s / n["time_s"]))


FORMULAS = (
    Formula(
        "drive-damping",
        "kelvin-voigt",
        lambda r: {"damping_Ns_per_m": r.uniform(25.0, 50.0)},
        rig=_kelvin_voigt,
    ),
    Formula(
        "drive-damping",
        "maxwell",
        lambda r: {"damping_Ns_per_m": r.uniform(30.0, 55.0), "time_s": r.uniform(2e-3, 6e-3)},
        rig=_maxwell,
    ),
    # 2 % is one standard deviation of the stiffness
    Formula(
        "drive-stiffness",
        "log-shift",
        lambda r: {"log_change": either(r) * r.uniform(0.15, 0.25)},
        rig=_stiffness,
    ),
    Formula(
        "drive-hardening",
        "cubic",
        lambda r: {"spring_cubic": r.uniform(0.10, 0.18)},
        rig=scales("spring_cubic"),
    ),
    Formula(
        "drive-hardening",
        "bilinear",
        lambda r: {"spring_knee": r.uniform(0.3, 0.5), "spring_knee_m": r.uniform(0.6e-3, 1.0e-3)},
        rig=scales("spring_knee", keeps=("spring_knee_m",)),
    ),
    Formula(
        "drive-hardening",
        "exponential",
        lambda r: {"spring_exponential": r.uniform(0.06, 0.10), "spring_exponential_m": r.uniform(0.8e-3, 1.2e-3)},
        rig=scales("spring_exponential", keeps=("spring_exponential_m",)),
    ),
    Formula(
        "drive-backlash",
        "soft-dead-zone",
        lambda r: {"backlash_m": r.uniform(120e-6, 250e-6)},
        rig=scales("backlash_m"),
    ),
    Formula(
        "drive-speed-ripple",
        "screw-pitch",
        lambda r: {"pitch_m": float(r.choice(SCREW_PITCH_m)), **_ripple_numbers(r)},
        run=_ripple_pitch,
    ),
    Formula(
        "drive-speed-ripple",
        "time",
        lambda r: {"frequency_Hz": float(np.exp(r.uniform(np.log(1.5), np.log(12.0)))), **_ripple_numbers(r)},
        run=_ripple_time,
    ),
    # the support that carries the drive: five springs stiff, its mode rings at each slip
    Formula(
        "frame-compliance",
        "drive-side-mode",
        lambda r: {
            "stiffness_N_per_m": 11700.0 * r.uniform(4.0, 7.0),
            "frequency_Hz": float(np.exp(r.uniform(np.log(30.0), np.log(300.0)))),
            "damping_ratio": r.uniform(0.01, 0.04),
        },
        rig=_structure("frame"),
    ),
    Formula(
        "base-compliance",
        "base-mode",
        lambda r: {
            "stiffness_N_per_m": float(np.exp(r.uniform(np.log(3e5), np.log(1e6)))),
            "frequency_Hz": float(np.exp(r.uniform(np.log(60.0), np.log(250.0)))),
            "damping_ratio": r.uniform(0.01, 0.04),
        },
        rig=_structure("base"),
    ),
    Formula(
        "piezo-roll-off",
        "first-order",
        lambda r: {"corner_Hz": r.uniform(2500.0, 4000.0)},
        run=_roll_off_1,
    ),
    Formula(
        "piezo-roll-off",
        "second-order",
        lambda r: {"corner_Hz": r.uniform(3000.0, 4500.0), "damping_ratio": r.uniform(0.8, 1.0)},
        run=_roll_off_2,
    ),
    Formula(
        "piezo-resonance",
        "above",
        lambda r: {
            "frequency_Hz": r.uniform(5200.0, 6500.0),
            "damping_ratio": r.uniform(0.02, 0.06),
            "share": r.uniform(0.5, 1.0),
        },
        run=_resonance,
    ),
    Formula(
        "piezo-resonance",
        "between",
        lambda r: {
            "frequency_Hz": r.uniform(3300.0, 4100.0),
            "damping_ratio": r.uniform(0.02, 0.06),
            "share": r.uniform(0.1, 0.25),
        },
        run=_resonance,
    ),
    Formula("piezo-sag", "load", lambda r: {"sag_load": r.uniform(0.35, 0.5)}, rig=scales("sag_load")),
    Formula(
        "piezo-sag",
        "heat",
        lambda r: {"loss": r.uniform(0.5, 0.9), "time_s": r.uniform(1.0, 3.0)},
        run=_sag_heat,
    ),
)
