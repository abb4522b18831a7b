"""A second list of effects of real rigs outside the library, for sets made after the first list, `outside.py`."""

import numba as nb
import numpy as np
from scipy.signal import lfilter

from tests.blind.generator.effect import Formula, Numbers, Signals, either, noise_of, noise_seed, scales
from tests.blind.generator.kernel import SAMPLE_RATE_HZ
from tests.blind.generator.runs import Tracks

Random = np.random.Generator
_USUAL_MPS2 = 0.02e-6 * (2.0 * np.pi * 3000.0) ** 2  # amplitude of the base's acceleration at 3 kHz


def _run_number(signals: Signals) -> int:
    """The start of a run on the track [nm], which differs from run to run, in place of its number."""
    return int(1e9 * signals["mass_position_m"][0])


def _wear_step(tracks: Tracks, s: float, n: Numbers) -> None:
    """Mild wear turns severe once in a run: friction steps up within some tenths of a second, and half of it runs in again.

    Hirst & Lancaster 1956, J. Appl. Phys. 27, 1057: the transition is sudden and each time at another distance.
    """
    random = noise_of(n, tracks.number)
    after_s = tracks.t_s - random.uniform(0.25, 0.75) * tracks.t_s[-1]
    risen = np.clip(after_s / n["rise_s"], 0.0, 1.0)
    left = 1.0 - 0.5 * (1.0 - np.exp(-np.maximum(after_s, 0.0) / n["settles_s"]))
    tracks.load *= 1.0 + s * n["height"] * risen * left


def _belt_mesh(tracks: Tracks, s: float, n: Numbers) -> None:
    """A toothed belt behind the drive's sensor moves once and twice a tooth too far and too short, both ways alike.

    Childs et al. 1997, Proc. IMechE D 211, 205: the error of transmission goes with the place of the pulley's teeth.
    """
    angle = 2.0 * np.pi * (tracks.origin_m + tracks.drive_m) / n["pitch_m"]
    error_m = np.sin(angle + n["phase_rad"]) + n["second"] * np.sin(2.0 * angle + n["phase_2_rad"])
    tracks.unseen_m += s * n["error_m"] * (error_m - error_m[0])


def _capillary(tracks: Tracks, s: float, n: Numbers) -> None:
    """Water from humid air bridges the contact while the rig waits for a run, by the logarithm of the time; sliding wears it off.

    Bocquet, Charlaix, Ciliberto & Crassous 1998, Nature 396, 735. The waits are from a minute to a night.
    """
    wait_s = float(np.exp(noise_of(n, tracks.number).uniform(np.log(60.0), np.log(4e4))))
    slid_m = np.concatenate(([0.0], np.cumsum(np.abs(np.diff(tracks.drive_m)))))
    share = np.log1p(wait_s / 60.0) / np.log1p(4e4 / 60.0)
    tracks.load *= 1.0 + s * n["height"] * share * np.exp(-slid_m / n["wears_m"])


def _beat(tracks: Tracks, s: float, n: Numbers) -> None:
    """The exciter's amplifier passes the ripple of its supply: the amplitude swings some times a second.

    Two converters on one intermediate circuit beat at the difference of their clocks (Erickson & Maksimovic 2001, ch. 10).
    """
    swing = np.sin(2.0 * np.pi * n["frequency_Hz"] * tracks.t_s + n["phase_rad"] + 2.0 * tracks.number)
    tracks.amplitude_m *= 1.0 + s * n["depth"] * swing


@nb.njit(cache=True)
def played(x: np.ndarray, width: float) -> np.ndarray:
    """A follower of `x` with play (samples,): it rests until `x` has moved on by half the width either way."""
    out = np.empty_like(x)
    at = x[0]
    for i in range(len(x)):
        at = min(max(at, x[i] - 0.5 * width), x[i] + 0.5 * width)
        out[i] = at
    return out


def _yaw(signals: Signals, s: float, n: Numbers) -> None:
    """A guide with play lets the slide yaw at each reversal, and the displacement sensor off its axis reads that as motion.

    Abbe's error: the angle of the play times the sensor's distance from the axis (Slocum 1992, Precision Machine Design, ch. 2).
    """
    signals["mass_position_m"] = played(signals["mass_position_m"], s * n["play_m"])


def _converter_line(signals: Signals, s: float, n: Numbers) -> None:
    """A converter that switches near the sampling rate aliases to a slow sine in the force, without a filter before it.

    Its frequency is the difference of two clocks and wanders with their temperature (Oppenheim & Schafer 1999, ch. 4).
    """
    t_s, random = signals["t_s"], noise_of(n, _run_number(signals))
    wander = 0.1 * np.sin(2.0 * np.pi * 0.05 * t_s + random.uniform(0.0, 2.0 * np.pi))
    turns = np.cumsum(n["folded_Hz"] * (1.0 + wander)) / SAMPLE_RATE_HZ
    signals["drive_force_N"] += s * n["line_N"] * np.sin(2.0 * np.pi * turns + random.uniform(0.0, 2.0 * np.pi))


@nb.njit(cache=True)
def _upper_range(force_N: np.ndarray, up_N: float, down_N: float) -> np.ndarray:
    """Whether an amplifier is in its upper range, which it leaves at a lower force than it enters it."""
    out, upper = np.zeros(len(force_N), np.bool_), False
    for i in range(len(force_N)):
        size = abs(force_N[i])
        upper = size > up_N or (upper and size > down_N)
        out[i] = upper
    return out


def _range_switching(signals: Signals, s: float, n: Numbers) -> None:
    """The force amplifier ranges by itself; its upper range has another zero and coarser steps (Fraden 2016, ch. 3)."""
    force_N = signals["drive_force_N"]
    upper = _upper_range(force_N, n["up_N"], n["up_N"] - n["hysteresis_N"])
    step_N = s * n["step_N"]
    coarse_N = np.round((force_N + s * n["zero_N"]) / step_N) * step_N
    signals["drive_force_N"] = np.where(upper, coarse_N, force_N)


def _multiplexed(signals: Signals, s: float, n: Numbers) -> None:
    """One slow converter reads many gauges in turn, and the recorder repeats the slide's last position until the next turn.

    Austerlitz 2003, Data Acquisition Techniques Using PCs, ch. 3: a multiplexed converter with a hold.
    """
    turn = s * n["turn_s"] * SAMPLE_RATE_HZ  # samples
    at = np.arange(len(signals["t_s"]))
    begun = np.floor((at + n["offset"] * turn) / turn) * turn - n["offset"] * turn
    signals["mass_position_m"] = signals["mass_position_m"][np.maximum(np.ceil(begun), 0.0).astype(int)]


def _rectified(signals: Signals, s: float, n: Numbers) -> None:
    """The force amplifier's input stage rectifies the cable's pick-up of the vibration: its zero moves with the power.

    Analog Devices AN-671: rectification of signals far above an instrumentation amplifier's band.
    """
    keep = np.exp(-1.0 / (n["smooth_s"] * SAMPLE_RATE_HZ))
    power = lfilter([1.0 - keep], [1.0, -keep], signals["base_accel_mps2"] ** 2)
    signals["drive_force_N"] += s * n["zero_N"] * power / (0.5 * _USUAL_MPS2**2)


OUTSIDE_2_FORMULAS = (
    # friction heats rail and carriage unevenly, and their preload grows (Stein & Tu 1994, J. Dyn. Sys. Meas. Control 116, 372)
    Formula(
        "preload-growth",
        "friction-work",
        lambda r: {"preload_growth": r.uniform(0.2, 0.3), "preload_time_s": r.uniform(1.5, 5.0)},
        rig=scales("preload_growth", keeps=("preload_time_s",)),
    ),
    Formula(
        "wear-step",
        "mild-to-severe",
        lambda r: {
            "height": r.uniform(0.14, 0.24),
            "rise_s": r.uniform(0.05, 0.3),
            "settles_s": r.uniform(0.5, 2.0),
            "seed": noise_seed(r),
        },
        run=_wear_step,
    ),
    # each pass wipes the oil aside, and only a reversal meets it again (Cann, Damiens & Lubrecht 2004, Tribol. Int. 37, 859)
    Formula(
        "lubricant-starvation",
        "distance-one-way",
        lambda r: {"starvation": r.uniform(0.1, 0.2), "starvation_m": r.uniform(0.5e-3, 2e-3)},
        rig=scales("starvation", keeps=("starvation_m",)),
    ),
    Formula(
        "belt-mesh",
        "tooth-pitch",
        lambda r: {
            "pitch_m": float(r.choice((2e-3, 3e-3, 5e-3))),
            "error_m": r.uniform(60e-6, 100e-6),
            "second": r.uniform(0.2, 0.5),
            "phase_rad": r.uniform(0.0, 2.0 * np.pi),
            "phase_2_rad": r.uniform(0.0, 2.0 * np.pi),
        },
        run=_belt_mesh,
    ),
    # a second rail, not vibrated, with its own Stribeck velocity (Armstrong-Helouvry et al. 1994, Automatica 30, 1083)
    Formula(
        "second-guide",
        "lugre-beside",
        lambda r: {
            "guide_force_N": r.uniform(1.5, 3.0),
            "guide_static_share": r.uniform(0.3, 0.6),
            "guide_stribeck_mps": float(np.exp(r.uniform(np.log(2e-3), np.log(1e-2)))),
            "guide_stiffness_N_per_m": float(np.exp(r.uniform(np.log(3e5), np.log(2e6)))),
        },
        # force and stiffness alike, so that a weak guide breaks away after the same distance
        rig=scales("guide_force_N", "guide_stiffness_N_per_m", keeps=("guide_static_share", "guide_stribeck_mps")),
    ),
    Formula("guide-yaw", "play", lambda r: {"play_m": r.uniform(120e-6, 200e-6)}, sense=_yaw),
    Formula(
        "converter-line",
        "folded",
        lambda r: {
            "folded_Hz": float(np.exp(r.uniform(np.log(2.0), np.log(20.0)))),
            "line_N": r.uniform(0.2, 0.4),
            "seed": noise_seed(r),
        },
        sense=_converter_line,
    ),
    Formula(
        "range-switching",
        "schmitt",
        lambda r: {
            "up_N": r.uniform(12.0, 15.0),
            "hysteresis_N": r.uniform(0.5, 1.5),
            "zero_N": either(r) * r.uniform(0.3, 0.7),
            "step_N": r.uniform(0.1, 0.3),
        },
        sense=_range_switching,
    ),
    Formula(
        "slow-multiplexer",
        "hold",
        lambda r: {"turn_s": r.uniform(0.05, 0.1), "offset": r.uniform(0.0, 1.0)},
        sense=_multiplexed,
    ),
    Formula(
        "capillary-bridges",
        "logarithmic",
        lambda r: {"height": r.uniform(0.3, 0.45), "wears_m": r.uniform(1e-3, 4e-3), "seed": noise_seed(r)},
        run=_capillary,
    ),
    Formula(
        "exciter-beat",
        "supply-ripple",
        lambda r: {
            "depth": r.uniform(0.45, 0.6),
            "frequency_Hz": r.uniform(1.0, 8.0),
            "phase_rad": r.uniform(0.0, 2.0 * np.pi),
        },
        run=_beat,
    ),
    Formula(
        "vibration-rectified",
        "square",
        lambda r: {"zero_N": either(r) * r.uniform(0.9, 1.5), "smooth_s": r.uniform(0.01, 0.05)},
        sense=_rectified,
    ),
)
OUTSIDE_2 = tuple(formula.effect for formula in OUTSIDE_2_FORMULAS)
