"""Breakaways and re-sticks within a segment, and the variables that each breakaway could depend on."""

import numpy as np

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import Scales, Signals
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import Segment
from diagnosis.features.slips import SegmentSlips, find_slips
from diagnosis.gap.prepare import Prepared
from diagnosis.pictures.derivatives import motion


def slips_of(signals: Signals, segment: Segment, scales: Scales) -> SegmentSlips:
    """The slips of a segment that the drive force shows, in blocks of the run."""
    first = segment.first
    slips = find_slips({"drive_force_N": segment.sign * signals["drive_force_N"][first : segment.last]}, scales)
    return SegmentSlips(slips.tops + first, slips.bottoms + first, slips.middles + first, slips.weights)


def breakaways(rig: RigTable, run: Prepared, scales: Scales) -> tuple[Floats, dict[str, Floats]]:
    """Breakaway forces less the rig's static friction [N], and the variables that they could depend on; [breakaways] each.

    The names of the variables contain the unit. Segments under vibration are left out, as vibration lowers the breakaway force.
    """
    above: list[float] = []
    at: list[int] = []
    dwell_s: list[float] = []
    direction: list[float] = []
    if "drive_force_N" in run.signals:
        for segment in run.commands.segments:
            if segment.frequency_Hz > 0.0 or segment.drive_velocity_mps == 0.0:
                continue
            slips = slips_of(run.signals, segment, scales)
            # the dwell before the first breakaway begins before the segment, so this breakaway is left out
            for before, top in zip(slips.bottoms[:-1].tolist(), slips.tops[1:].tolist(), strict=True):
                above.append(segment.sign * float(run.signals["drive_force_N"][top]) - rig.static_force_N)
                at.append(top)
                dwell_s.append((top - before) * BLOCK_S)
                direction.append(segment.sign)
    columns = motion(rig, run)
    over = {name: columns[name][at] for name in ("time_s", "position_m", "drive_position_m") if name in columns}
    return np.array(above), over | {"dwell_s": np.array(dwell_s), "direction": np.array(direction)}
