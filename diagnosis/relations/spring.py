"""The spring relation: force less k_d times the extension. It holds for any friction and any motion."""

import math
from collections.abc import Sequence

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import BOW, scales_of
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.noise import SLOW_SHARE
from diagnosis.features.segments import SETTLING
from diagnosis.gap.prepare import Prepared
from diagnosis.model.sensor_chain import BEND_S2, ORDINARY
from diagnosis.relations.relation import RESOLUTION, Floats, Missing, Relation, Term, lacking, term, wander
from diagnosis.relations.shapes import bend, calmed, free, near_slips, rate, slip_phase
from diagnosis.relations.spring_effects import spring_effects

NEEDED = ("drive_force_N", "mass_position_m", "drive_position_m")
_HIGHEST_HZ = 120.0  # slips end below; above, a block mean of 1 ms is not the value at its middle
_SOFT = 0.1  # of the mean rate of the extension: below, it has no direction


def spring_relation(rig: RigTable, runs: list[Prepared]) -> Relation | Missing:
    """The relation in N, with its columns; `Missing` where a run lacks a channel."""
    stiffness = rig.drive_stiffness_N_per_m
    if stiffness is None:
        return Missing("spring", 'drive = "force": the rig has no drive spring')
    if why := lacking(NEEDED, runs):
        return Missing("spring", why)
    damping = rig.drive_damping_Ns_per_m or 0.0
    force = [run.signals["drive_force_N"] for run in runs]
    drive = [run.signals["drive_position_m"] for run in runs]
    slide = [run.signals["mass_position_m"] for run in runs]
    extension = [s - x for s, x in zip(drive, slide, strict=True)]
    zero_m = float(np.mean([np.mean(f / stiffness - e) for f, e in zip(force, extension, strict=True)]))
    extension = [e + zero_m for e in extension]
    left = tuple(f - stiffness * e - damping * rate(e) for f, e in zip(force, extension, strict=True))
    near = [near_slips(x) for x in slide]
    drive, slide = ([calmed(p, w) for p, w in zip(positions, near, strict=True)] for positions in (drive, slide))
    extension = [s - x + zero_m for s, x in zip(drive, slide, strict=True)]
    rates = [rate(e) for e in extension]
    middle_m = float(np.mean([s.mean() for s in drive]))
    bow_per_m = BOW / float(np.ptp(np.concatenate(drive)))

    known = math.hypot(rig.tolerance.get("drive_stiffness_N_per_m", 0.0), ORDINARY["position_scale"][1])
    delay_s = math.hypot(ORDINARY["force_delay_s"][1], ORDINARY["position_delay_s"][1])
    nuisances = [
        term("drive_stiffness_N_per_m", "", extension, known * stiffness),
        term("delay", "", [-stiffness * v for v in rates], delay_s),
        term("bend", "", [stiffness * bend(e) for e in extension], BEND_S2),
        wander([len(values) for values in left], SLOW_SHARE * rig.static_force_N),
    ]
    if damping > 0.0 and (tolerance := rig.tolerance.get("drive_damping_Ns_per_m", 0.0)) > 0.0:
        nuisances.append(term("drive_damping_Ns_per_m", "", rates, tolerance * damping))
    for name, position in (("drive", drive), ("mass", slide)):
        about = [p - middle_m for p in position]
        nuisances.append(
            term(f"slope of the {name} sensor", "", [stiffness * p for p in about], ORDINARY["drive_slope"][1])
        )
        nuisances.append(term(f"bow of the {name} sensor", "", [stiffness * p * p for p in about], bow_per_m))
    most_N = max(float(np.abs(f).max()) for f in force)
    return Relation(
        name="spring", unit="N", row_s=BLOCK_S, highest_Hz=_HIGHEST_HZ, left=left,
        pieces=tuple(((SETTLING, len(values) - SETTLING),) for values in left),
        nuisances=tuple(nuisances),
        effects=tuple(spring_effects(rig, extension, rates, runs, most_N)),
        patterns=tuple(_patterns(rig, extension, rates, drive)),
        resolution=RESOLUTION * rig.static_force_N,
    )  # fmt: skip


def _patterns(
    rig: RigTable, extension: Sequence[Floats], rates: Sequence[Floats], drive: Sequence[Floats]
) -> list[Term]:
    since = [slip_phase(v, scales_of(rig).slip_s) for v in rates]
    loading = free("the extension", extension, 14)
    soft_mps = _SOFT * float(np.mean(np.abs(np.concatenate(rates))))
    return [
        loading,
        free("the rate of the extension", rates, 12),
        Term("the extension, by direction", "", tuple(
            hat * np.tanh(v / soft_mps)[:, None] for hat, v in zip(loading.values, rates, strict=True)), math.nan),
        free("the time since a slip", since, 14),
        free("the place of the drive", drive, 30),
        free("the time in a run", [np.arange(len(v)) * BLOCK_S for v in rates], 24),
    ]  # fmt: skip
