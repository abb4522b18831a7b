"""Every effect of the diagnosis: its meaning, the residual that shows it, how each form is tried, the check by hand.

The physics is in `plant.effects`. A form that is missing here is not tried: it is a random form, whose path no prediction can
follow.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.prepare import Prepared
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.hypothesis import LEVELS, MASS, Coordinate, Hypothesis, Scale, Sizes, sizes
from diagnosis.hypotheses.starts import (
    Starts,
    Trial,
    TrialRequest,
    aged_before,
    at_scale,
    at_times_its_scale,
    at_times_the_vibration,
    at_values,
    bumps_of_track,
    two_waves_of_track,
    waves_of_motor,
    waves_of_screw,
    waves_of_time,
    waves_of_track,
    where_the_base_rings,
)
from plant.effects.library import EFFECTS


@dataclass(frozen=True)
class Tried:
    """How a form is tried. Parameters without a scale keep their default."""

    # scales of the free parameters on a rig of these sizes; none where the starts define the coordinates
    scale: Callable[[Sizes], dict[str, Scale]] = lambda _: {}
    starts: Starts = at_scale


Over = tuple[str, str]  # a residual and its variable: names of `pictures.choice`


class EffectRow(NamedTuple):
    """An effect in the diagnosis."""

    words: str  # meaning on a machine, in plain words
    shown_by: tuple[Over, ...]  # residuals that show the effect, the best first; the next if channels are missing
    forms: dict[str, Tried]
    check: str = ""  # check by hand; empty: the check for the part on which it acts
    check_against: dict[str, str] = {}  # check by hand that separates it from another effect, stated in one of the rows
    shown_twice: bool = False  # whether two of `shown_by` are drawn, as its forms show over different variables


BREAKAWAY: Final = "breakaway"
OVER_SPEED: Final = (("friction", "velocity_mps"),)
OF_RATE: Final = (("spring", "extension_rate_mps"), ("curvature", "acceleration_mps2"))
OF_EXTENSION: Final = (("spring", "extension_m"), ("curvature", "acceleration_mps2"))
OF_EXCITER: Final = (("exciter", "frequency_Hz"),)

WEIGHT: Final = "Hang a known weight on the force sensor, and read it empty: its gain and its zero are then known."
ZERO: Final = "Unload the force sensor and read it for ten minutes: a zero that wanders is seen at once."
TAP: Final = (
    "Hold the mass still and tap the drive with a small hammer: a late or smoothed force reading shows against the "
    "accelerometer, damping and compliance of the drive as ringing."
)
FRAME: Final = (
    "Put an accelerometer on the mount of the drive, then on the base, and tap: a part that swings is seen directly."
)
SHAKER: Final = "Put both accelerometers on one calibrated shaker, or turn them over: gravity makes 2 g of difference."
SWEEP: Final = (
    "Sweep the piezo from 0.5 to 5 kHz at rest and look at the base accelerometer: it shows the delivered motion."
)
DRIVE: Final = (
    "Measure the drive position with a second sensor, unloaded: an uneven drive is uneven without the mass, too."
)
TRACK: Final = (
    "Drag along the same track twice, the second time at another speed: an effect of the place returns there."
)
SPEEDS: Final = "Drag at 0.2, 1 and 5 times the present speed, and hold the drive for 1, 10 and 60 s in between."
REVERSE: Final = "Drag to and fro over the same track."
REPEAT: Final = "Repeat one run unchanged after a pause of ten minutes: a drift does not repeat."


_RESTED = {"rested_s": Scale(0.3, True, 1.5)}
_MODE = {"resonance_Hz": Scale(1.0, True, 0.7), "damping_ratio": Scale(0.05, True, 0.7)}
_DAMPING_RATIO = {"damping_ratio": Scale(0.05, True, 0.7)}


def _level(_: Sizes) -> dict[str, Scale]:
    """A wide prior, so that the rig's number, which has taken up a part of the deviation, returns to its described value."""
    return {"ratio": Scale(0.1, False, 3.0)}


def _gain(_: Sizes) -> dict[str, Scale]:
    return {"ratio": Scale(0.05, False)}


CATALOGUE: Final[dict[str, EffectRow]] = {
    "static-friction-ageing": EffectRow(
        words="the longer the contact rests, the more force it takes to break it away",
        shown_by=((BREAKAWAY, "dwell_s"),),
        forms={
            "log": Tried(
                lambda _: {"ratio": Scale(0.02, True, 1.5), "age_scale_s": Scale(0.1, True, 1.5)} | _RESTED, aged_before
            ),
            "power": Tried(
                lambda _: {"ratio": Scale(0.04, True, 1.5), "exponent": Scale(0.3, True, 0.5)} | _RESTED, aged_before
            ),
            "settling": Tried(
                lambda _: {"ratio": Scale(0.05, True, 1.5), "settling_s": Scale(0.5, True, 1.0)} | _RESTED, aged_before
            ),
        },
        check_against={"static-level": SPEEDS},
    ),
    "frictional-lag": EffectRow(
        words="friction follows a change of speed a little late",
        shown_by=OVER_SPEED,
        forms={
            "time": Tried(lambda rig: {"lag_s": Scale(0.06 * rig.slip_s, True, 1.5)}),
            "dead-time": Tried(
                lambda rig: {"delay_s": Scale(0.03 * rig.slip_s, True, 1.5), "share": Scale(0.7, True, 0.5)},
                at_times_its_scale("delay_s", 0.4, 2.5),
            ),
            "distance": Tried(
                lambda rig: {"distance_m": Scale(0.005 * rig.reach_m, True, 1.5), "share": Scale(0.5, True, 0.7)},
                at_times_its_scale("distance_m", 0.4, 1.0, 3.0),
            ),
        },
    ),
    "viscous-friction": EffectRow(
        words="friction grows with speed, as with thick oil",
        shown_by=OVER_SPEED,
        forms={
            "linear": Tried(lambda rig: {"damping_Ns_per_m": Scale(0.02 * rig.critical_Ns_per_m, True, 1.5)}),
            "quadratic": Tried(
                lambda rig: {"damping_Ns2_per_m2": Scale(0.02 * rig.critical_Ns_per_m / rig.slip_mps, True, 1.5)}
            ),
        },
    ),
    "position-dependent-friction": EffectRow(
        words="friction changes along the way, and is the same again at the same place",
        shown_by=(("friction", "position_m"), (BREAKAWAY, "position_m"), (BREAKAWAY, "time_s")),
        forms={
            "wave": Tried(starts=waves_of_track),
            "two-waves": Tried(starts=two_waves_of_track),
            "bumps": Tried(starts=bumps_of_track),
        },
        check=TRACK,
        check_against={"normal-load-fluctuation": TRACK, "drive-speed-ripple": DRIVE, "friction-drift": REPEAT},
    ),
    "direction-dependent-friction": EffectRow(
        words="friction differs between forward and backward",
        shown_by=((BREAKAWAY, "direction"), *OVER_SPEED),
        forms={"backward": Tried(_level), "both": Tried(_level), "kinetic": Tried(_level)},
        check=REVERSE,
    ),
    "normal-load-fluctuation": EffectRow(
        words="the force that presses the surfaces together goes up and down",
        shown_by=(("friction", "time_s"), (BREAKAWAY, "time_s")),
        forms={"sine": Tried(starts=waves_of_time)},
        check=TRACK,
        check_against={"drive-speed-ripple": DRIVE},
    ),
    "friction-drift": EffectRow(
        words="friction wanders slowly over the run, as with running in or warming up",
        shown_by=((BREAKAWAY, "time_s"), ("friction", "time_s")),
        forms={
            "linear": Tried(lambda rig: {"rate_per_s": Scale(0.03 / rig.length_s, False)}),
            "settling": Tried(
                lambda rig: {"ratio": Scale(0.04, False), "settling_s": Scale(0.3 * rig.length_s, True, 0.7)}
            ),
            "session": Tried(lambda rig: {"ratio": Scale(0.04, False), "settling_s": Scale(rig.length_s, True, 1.0)}),
        },
        check=REPEAT,
    ),
    "coulomb-level": EffectRow(
        words="sliding friction is further from the described value than its tolerance allows",
        shown_by=OVER_SPEED,
        forms={"": Tried(_level)},
    ),
    "static-level": EffectRow(
        words="breakaway friction is further from the described value than its tolerance allows",
        shown_by=((BREAKAWAY, "dwell_s"),),
        forms={"": Tried(_level)},
    ),
    "stribeck-velocity": EffectRow(
        words="the speed over which friction falls is further from the described value than its tolerance allows",
        shown_by=OVER_SPEED,
        forms={"": Tried(lambda _: {"ratio": Scale(0.5, False)})},
    ),
    "drive-damping": EffectRow(
        words="the drive damps its own oscillation, as a rubber coupling does",
        shown_by=OF_RATE,
        forms={
            "viscous": Tried(lambda rig: {"damping_Ns_per_m": Scale(0.03 * rig.critical_Ns_per_m, True, 1.5)}),
            "relaxing": Tried(
                lambda rig: {
                    "damping_Ns_per_m": Scale(0.1 * rig.critical_Ns_per_m, True, 1.5),
                    "relaxation_s": Scale(0.1 * rig.slip_s, True, 1.0),
                }
            ),
        },
    ),
    "drive-stiffness": EffectRow(
        words="the drive is stiffer or softer than its tolerance allows",
        shown_by=OF_EXTENSION,
        forms={"": Tried(_level)},
    ),
    "drive-hardening": EffectRow(
        words="the drive becomes stiffer or softer the further it is loaded",
        shown_by=OF_EXTENSION,
        forms={
            "cubic": Tried(lambda rig: {"ratio": Scale(0.1 * (1e-3 / rig.reach_m) ** 2, False)}),
            "bilinear": Tried(lambda rig: {"ratio": Scale(0.2, False), "knee_m": Scale(0.75 * rig.reach_m, True, 0.3)}),
        },
    ),
    "drive-backlash": EffectRow(
        words="play in the drive: it moves a little without any force when the load changes sign",
        shown_by=OF_EXTENSION,
        forms={"": Tried(lambda rig: {"gap_m": Scale(0.05 * rig.reach_m, True, 1.5)})},
    ),
    "drive-speed-ripple": EffectRow(
        words="the drive runs unevenly, for example once a turn of its screw",
        shown_by=(("drive", "drive_position_m"), (BREAKAWAY, "time_s")),
        forms={
            "screw": Tried(starts=waves_of_screw),
            "time": Tried(starts=waves_of_motor),
            "load": Tried(starts=waves_of_screw),
        },
        check=DRIVE,
    ),
    "frame-compliance": EffectRow(
        words="the mount of the drive yields and swings",
        shown_by=OF_RATE,
        forms={
            "": Tried(
                lambda _: {"ratio": Scale(0.05, True, 1.5), "frequency_Hz": Scale(80.0, True, 0.5)} | _DAMPING_RATIO,
                at_values("frequency_Hz", 40.0, 90.0, 200.0),
            )
        },
        check=FRAME,
        check_against={"drive-damping": FRAME, "base-compliance": FRAME, "drive-stiffness": FRAME},
    ),
    "base-compliance": EffectRow(
        words="the mount of the base yields and swings",
        shown_by=OVER_SPEED,
        forms={
            "": Tried(
                lambda rig: (
                    {
                        "compliance_m_per_N": Scale(1e-3 / rig.stiffness_N_per_m, True, 2.0),
                        "frequency_Hz": Scale(150.0, True, 0.5),
                    }
                    | _DAMPING_RATIO
                ),
                where_the_base_rings,
            )
        },
        check=FRAME,
    ),
    "piezo-roll-off": EffectRow(
        words="the piezo moves less than commanded at high frequency",
        shown_by=OF_EXCITER,
        # several starts, as a fit that starts far from the corner ends in a local minimum
        forms={
            "first-order": Tried(
                lambda rig: {"corner_Hz": Scale(2.0 * max(rig.highest_Hz, 1.0), True, 1.5)},
                at_times_the_vibration("corner_Hz", 0.9, 2.0),
            ),
            "second-order": Tried(
                lambda rig: {"corner_Hz": Scale(3.0 * max(rig.highest_Hz, 1.0), True, 1.5)},
                at_times_the_vibration("corner_Hz", 0.9, 2.0),
            ),
        },
    ),
    "piezo-resonance": EffectRow(
        words="the piezo moves more than commanded near its own resonance",
        shown_by=OF_EXCITER,
        forms={
            "mount": Tried(lambda _: _MODE, at_times_the_vibration("resonance_Hz", 0.5, 0.75, 0.9, 1.2, 2.0)),
            "mode": Tried(
                lambda _: {"ratio": Scale(0.3, True, 1.5)} | _MODE,
                at_times_the_vibration("resonance_Hz", 0.5, 0.75, 0.9, 1.2, 2.0),
            ),
        },
    ),
    "piezo-sag": EffectRow(
        words="the piezo moves less than commanded under load or when warm",
        shown_by=(("exciter", "force_N"), ("exciter", "time_s")),
        forms={
            "load": Tried(lambda _: {"ratio": Scale(0.2, False)}),
            "heat": Tried(lambda rig: {"ratio": Scale(0.2, False), "settling_s": Scale(0.2 * rig.length_s, True, 0.7)}),
        },
        shown_twice=True,
    ),
    "force-sensor-gain": EffectRow(
        words="the force sensor reads too much or too little by a constant share",
        shown_by=OF_EXTENSION,
        forms={"": Tried(_gain)},
        check=WEIGHT,
        check_against={"coulomb-level": WEIGHT, "static-level": WEIGHT, "drive-stiffness": WEIGHT},
    ),
    "force-sensor-bias": EffectRow(
        words="the force sensor reads too much or too little by a constant force",
        shown_by=OVER_SPEED,
        forms={"": Tried(lambda rig: {"bias_N": Scale(0.03 * rig.static_N, False)})},
        check=WEIGHT,
        check_against={"direction-dependent-friction": WEIGHT},
    ),
    "force-sensor-drift": EffectRow(
        words="the zero of the force sensor wanders",
        shown_by=(("spring", "time_s"), (BREAKAWAY, "time_s")),
        forms={
            "linear": Tried(lambda rig: {"rate_N_per_s": Scale(0.03 * rig.static_N / rig.length_s, False)}),
            "settling": Tried(
                lambda rig: {
                    "drift_N": Scale(0.03 * rig.static_N, False),
                    "settling_s": Scale(0.3 * rig.length_s, True, 0.7),
                }
            ),
        },
        check=ZERO,
        check_against={"friction-drift": ZERO},
    ),
    "force-sensor-lag": EffectRow(
        words="the force sensor smooths: its reading creeps after the force",
        shown_by=OF_RATE,
        forms={
            "first-order": Tried(lambda rig: {"lag_s": Scale(0.02 * rig.slip_s, True, 1.5)}),
            "second-order": Tried(lambda rig: {"lag_s": Scale(0.01 * rig.slip_s, True, 1.5)}),
            "fourth-order": Tried(lambda rig: {"lag_s": Scale(0.005 * rig.slip_s, True, 1.5)}),
        },
        check=TAP,
        check_against={"drive-damping": TAP, "force-sensor-delay": TAP, "frictional-lag": TAP},
    ),
    "force-sensor-delay": EffectRow(
        words="the force reading comes late but unchanged",
        shown_by=OF_RATE,
        forms={"": Tried(lambda rig: {"delay_s": Scale(0.02 * rig.slip_s, True, 1.5)})},
        check=TAP,
        check_against={"drive-damping": TAP},
    ),
    "accelerometer-gain": EffectRow(
        words="the accelerometer reads too much or too little by a constant share",
        shown_by=(("motion", "acceleration_mps2"), ("curvature", "acceleration_mps2"), *OF_EXCITER),
        forms={"both": Tried(_gain), "mass": Tried(_gain), "base": Tried(_gain)},
        check=SHAKER,
    ),
}


def trials(problem: Problem) -> list[Trial]:
    """Every form of every effect that this rig can have and these runs could show, and another mass."""
    rig, runs = problem.rig, problem.runs
    frequencies = np.concatenate([run.commands.frequency_Hz for run in runs])
    highest_Hz = float(frequencies.max())
    of_rig = sizes(rig, runs, highest_Hz)
    result: list[Trial] = []
    for name, effect in EFFECTS.items():
        if not _shows(name, rig, highest_Hz):
            continue
        for form in effect.forms:
            tried = CATALOGUE[name].forms.get(form)
            if tried is not None:
                result += tried.starts(TrialRequest(name, form, tried.scale(of_rig), problem, highest_Hz))
    (scale, logarithmic, prior) = _level(of_rig)["ratio"]
    mass = Coordinate(MASS, "ratio", scale, logarithmic, prior, -0.9, 9.0)
    return [*result, Trial(Hypothesis({MASS: ""}, (mass,)), np.array([0.5]))]


def cannot_show(rig: RigTable, runs: Sequence[Prepared], assumed: Sequence[str]) -> tuple[str, ...]:
    """Effects that this kind of drive cannot have, that need a missing vibration, or that change an assumed rig number."""
    highest_Hz = max(float(run.commands.frequency_Hz.max()) for run in runs)
    unseen = (name for name in EFFECTS if not _shows(name, rig, highest_Hz) or LEVELS.get(name) in assumed)
    return (*unseen, *((MASS,) if LEVELS[MASS] in assumed else ()))


def _shows(name: str, rig: RigTable, highest_Hz: float) -> bool:
    effect = EFFECTS[name]
    return rig.drive in effect.drives and (effect.acts_on != "piezo" or highest_Hz > 0.0)
