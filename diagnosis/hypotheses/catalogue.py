"""Every effect of the diagnosis: its meaning, the residual that shows it, how each form is tried, the check by hand.

The physics is in `plant.effects`. A form that is missing here is not tried: it is a random form, whose path no prediction can
follow; `diagnosis.fits.random_friction` searches for it.
"""

from typing import Final

from diagnosis.hypotheses.catalogue_row import (
    BREAKAWAY,
    DRIVE,
    FRAME,
    OF_EXCITER,
    OF_EXTENSION,
    OF_RATE,
    OVER_SPEED,
    REPEAT,
    REVERSE,
    SHAKER,
    SPEEDS,
    TAP,
    TRACK,
    WEIGHT,
    ZERO,
    EffectRow,
    Tried,
)
from diagnosis.hypotheses.scales import Scale, Sizes
from diagnosis.hypotheses.starts import (
    aged_before,
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

_RESTED = {"rested_s": Scale(0.3, True, 1.5)}
_WAVE = {"ratio": Scale(0.02, True, 1.5), "phase_rad": Scale(1.0, False, 3.0)}
_ALONG_WAY = _WAVE | {"wavelength_m": Scale(1.0, True, 0.2)}
_OVER_TIME = _WAVE | {"frequency_Hz": Scale(1.0, True, 0.2)}
_MODE = {"resonance_Hz": Scale(1.0, True, 0.7), "damping_ratio": Scale(0.05, True, 0.7)}
_DAMPING_RATIO = {"damping_ratio": Scale(0.05, True, 0.7)}


def _level(_: Sizes) -> dict[str, Scale]:
    """A wide prior, so that the rig's number, which has taken up a part of the deviation, returns to its described value."""
    return {"ratio": Scale(0.1, False, 3.0)}


def _gain(_: Sizes) -> dict[str, Scale]:
    return {"ratio": Scale(0.05, False)}


def _by_waves(_: Sizes) -> dict[str, Scale]:
    """No scales, as the starts from waves define their coordinates."""
    return {}


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
            "wave": Tried(lambda _: _ALONG_WAY, waves_of_track),
            "two-waves": Tried(_by_waves, two_waves_of_track),
            "bumps": Tried(_by_waves, bumps_of_track),
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
        forms={"sine": Tried(lambda _: _OVER_TIME, waves_of_time)},
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
            "screw": Tried(lambda _: _ALONG_WAY, waves_of_screw),
            "time": Tried(lambda _: _OVER_TIME, waves_of_motor),
            "load": Tried(lambda _: _ALONG_WAY, waves_of_screw),
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
