"""The motion relation: acceleration of the slide less the second derivative of its position."""

import math

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import scales_of
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.model.sensor_chain import BEND_S2, ORDINARY
from diagnosis.relations.relation import (
    POSITION_HZ,
    RESOLUTION,
    SKEW,
    Missing,
    Relation,
    pieces_without_vibration,
    term,
)
from diagnosis.relations.shapes import bend, calmed, free, near_slips, rate, slip_phase

NEEDED = ("mass_accel_mps2", "mass_position_m")


def motion_relation(rig: RigTable, runs: list[Prepared]) -> Relation | Missing:
    """The relation in m/s2, away from vibration; `Missing` where a run lacks a channel or always vibrates."""
    pieces = pieces_without_vibration("motion", NEEDED, runs)
    if isinstance(pieces, Missing):
        return pieces
    accel = [run.signals["mass_accel_mps2"] for run in runs]
    position = [run.signals["mass_position_m"] for run in runs]
    left = tuple(a - bend(x) for a, x in zip(accel, position, strict=True))
    sticks = rig.drive == "spring"
    near = [near_slips(x) if sticks else np.ones(len(x)) for x in position]
    velocity = [rate(calmed(x, w)) for x, w in zip(position, near, strict=True)]
    accel = [w * calmed(a, w) for a, w in zip(accel, near, strict=True)]  # a slide that sticks shows noise alone
    jerk = [rate(a) for a in accel]
    own_s = [(np.arange(len(a)) + 0.5) * BLOCK_S for a in accel]
    whole_s = [t + run.before_s for t, run in zip(own_s, runs, strict=True)]
    since = [slip_phase(v, scales_of(rig).slip_s if rig.drive == "spring" else 0.05) for v in velocity]
    return Relation(
        name="motion", unit="m/s2", row_s=BLOCK_S, highest_Hz=POSITION_HZ,
        left=left, pieces=pieces,
        nuisances=(
            term("scale of the position", "", accel, math.hypot(ORDINARY["position_scale"][1], ORDINARY["drive_slope"][1])),
            term("delay", "", jerk, math.hypot(*ORDINARY["position_delay_s"])),
            term("bend", "", [rate(j) for j in jerk], BEND_S2),
            term("lowest frequency", "", velocity, 2.0 * math.pi * math.hypot(*ORDINARY["accel_lowest_Hz"])),
        ),
        effects=(
            term("accelerometer-gain", "mass", accel, 0.2, 0, "ratio"),
            *(
                term("acceleration-clock", form, [-t * j for t, j in zip(times, jerk, strict=True)], SKEW, 0, "skew")
                for form, times in (("in each run", own_s), ("since the first run", whole_s))
            ),
        ),
        patterns=(
            free("the acceleration", accel, 12),
            free("the velocity", velocity, 12),
            free("the time since a slip", since, 14),
        ),
        resolution=RESOLUTION * rig.static_force_N / rig.mass_kg,
    )  # fmt: skip
