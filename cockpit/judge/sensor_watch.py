"""Whether the sensors of a run can carry a verdict: dead, clipped, swapped and absent channels, and three witnesses of slips.

Window by window, in a memory that does not grow but for the times of slips. A check makes no statement where it has nothing to
compare.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.log.check.channel import FEW_AT_END, channel_findings
from bridge.log.check.log_check import LogWatch
from bridge.units import counted
from bridge.wire.messages import CHANNELS
from cockpit.judge.described import Described
from cockpit.judge.machine_terms import noise_of
from cockpit.judge.phases import Stretches, within
from cockpit.judge.relations import Doubt, SameRelation, SpringRelation
from cockpit.judge.slips import Forces
from cockpit.judge.watches import FrozenWatch
from cockpit.judge.window import Window, means

Floats = npt.NDArray[np.floating[Any]]

_FROZEN_S = (
    0.1  # of blocks that repeat the one before. Larger: a shorter failure passes; smaller: a doubled block counts
)
# Share of samples that are no numbers, from which a channel cannot carry a verdict. Larger: more is left out unseen; smaller: a
# single dropout of a long run takes its verdict.
_NOT_FINITE_SHARE = 1e-3
_SIGMAS = 10.0  # of noise in a fall that counts as a slip, as in `diagnosis.features.cycles`, whose value this is
_CODES = {"not-finite": "SENSOR_ABSENT", "dead": "SENSOR_DEAD", "clipped": "SENSOR_CLIPPED"}
# Slips that one witness may see alone, at the edge of a stretch or of what counts, and the same against two that see none.
# Smaller: the 7 that the bank's controller counts where nothing slips take its verdict; larger: a blind force sensor passes.
_FEW_SLIPS, _MANY_SLIPS = 3, 10


class SensorVerdict(NamedTuple):
    """What the sensors say of themselves."""

    findings: list[Doubt]
    by_force: int  # slips in the judged stretches
    by_position: int | None  # None where the positions cannot show one
    by_trace: int
    surges: int  # of `by_trace`

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        return self._asdict() | {"findings": [finding._asdict() for finding in self.findings]}


class SensorWatch:
    """Looks at one log, window by window.

    Args:
        of: the description in the log.
        log: its channels.
        frozen: their blocks that repeat.

    """

    def __init__(self, of: Described, log: LogWatch, frozen: FrozenWatch) -> None:
        self._of, self._log, self._frozen = of, log, frozen
        self._spring, self._same = SpringRelation(of), SameRelation(of)
        self._noise_N = math.inf  # of the force's bins, in the window with the least
        self._least_m = 0.0  # the smallest fall of drive less slide that counted in every window
        self._slips_s: dict[str, list[Floats]] = {"position": [], "slips": [], "surges": []}

    def add(self, window: Window, forces: Forces) -> None:
        """Take a window with its slips by force and by position."""
        blocks, rows = window.blocks, slice(window.first, window.end)
        bins = blocks.drive_m.shape[1]
        force_N = means(np.where(np.isfinite(blocks.force_N[rows]), blocks.force_N[rows], np.nan), bins)
        finite = np.isfinite([force_N, blocks.drive_m[rows], blocks.slide_m[rows]]).all(axis=(0, 2))
        block_s = self._log.period_ns * 1e-9
        t_s = np.repeat(blocks.t_ns[rows][finite] * 1e-9, bins)
        behind_m = (blocks.drive_m[rows][finite] - blocks.slide_m[rows][finite]).ravel()
        self._spring.add(t_s, force_N[finite].ravel(), behind_m, block_s / bins)
        self._same.add(window, rows, force_N.mean(axis=1))
        if finite.sum() * bins > 2:
            self._noise_N = min(self._noise_N, noise_of(force_N[finite].ravel()))
        self._least_m = max(self._least_m, forces.least_m)
        self._slips_s["position"].append(forces.by_position_s)
        from_ns, until_ns = window.own_ns
        trace_ns = window.trace["t_ns"]
        for name in ("slips", "surges"):
            more = np.diff(
                window.trace[name], prepend=window.trace[name][:1]
            )  # a controller that begins again counts from 0
            own = (trace_ns >= from_ns) & (trace_ns < until_ns) & (more > 0)
            self._slips_s[name].append(np.repeat(trace_ns[own] * 1e-9, more[own]))

    def result(self, force_slips_s: Floats, judged: Stretches) -> SensorVerdict:
        """All of it, at the end of the log.

        Args:
            force_slips_s: times of the slips in the drive force [s].
            judged: stretches [s] in which slips count.

        """
        found = {name: self._of_channel(name) for name in CHANNELS}
        findings = [doubt for doubts in found.values() for doubt in doubts]
        sound = {name for name, doubts in found.items() if not doubts}
        if (
            {"drive_force_N", "mass_position_m", "drive_position_m"} <= sound
            and self._of.uses_force
            and self._of.uses_slide
        ):
            findings += self._spring.doubts()
        if {"drive_force_N", "base_accel_mps2"} <= sound:
            findings += self._same.doubts()
        times = {name: np.concatenate([np.empty(0), *parts]) for name, parts in self._slips_s.items()}
        whole = {name: len(at_s) for name, at_s in times.items()}
        by_position, slips, surges = (int(within(at_s, judged).sum()) for at_s in times.values())
        by_force = int(within(force_slips_s, judged).sum())
        shows = self._least_m < self._of.slip_m or whole["position"] > 0
        if self._of.uses_force:
            # surges at stops and turns are no witness; two witnesses that agree are more than one, so a controller that counts
            # slips where force and positions show none decides nothing
            missed = by_force == 0 and (
                min(by_position, slips) > 0
                or by_position >= _FEW_SLIPS
                or (not shows and slips >= _FEW_SLIPS and self._of.drop_N != 0.0)
            )
            missed |= len(force_slips_s) == 0 and min(whole["position"], whole["slips"]) > 0
            alone = by_force >= _MANY_SLIPS and shows and by_position == 0 and slips + surges == 0
            if missed or alone:
                shown = f"show {counted(by_position, 'slip')}" if shows else "cannot show slips"
                text = (
                    f"the drive force shows {counted(by_force, 'slip')}, the positions of drive and slide {shown}, the "
                    f"controller counted {counted(slips + surges, 'slip')}, {surges} of them surges; over the whole log "
                    f"{len(force_slips_s)}, {whole['position']} and {whole['slips'] + whole['surges']}"
                )
                findings.append(Doubt("SLIPS_DISAGREE", text, True))
        fall_N = 2.0 * self._of.drop_N
        if self._of.uses_force and self._of.slip_m > 0.0 and fall_N < _SIGMAS * self._noise_N < math.inf:
            text = f"drive_force_N has noise of {self._noise_N:.3g} N in 1 ms, in which a slip of {fall_N:.3g} N is not seen"
            findings.append(Doubt("SENSOR_NOISE", text, True))
        return SensorVerdict(findings, by_force, by_position if shows else None, slips + surges, surges)

    def _of_channel(self, name: str) -> list[Doubt]:
        seen, of, log = self._log.signals[name].result(), self._of.channels[name], self._log
        live = seen.constant or of.is_noisy or not math.isfinite(of.noise)  # equal samples are a fault
        found: list[Doubt] = []
        for finding in channel_findings(name, seen, log.sample_s, of):
            serious = {
                "not-finite": finding.times > _NOT_FINITE_SHARE * seen.samples,
                "dead": live,
                "clipped": finding.times > FEW_AT_END,
            }
            if serious[finding.kind]:
                found.append(Doubt(_CODES[finding.kind], f"{name} {finding.text}", self._decides(name)))
        repeats_s = self._frozen.runs[name].longest * log.period_ns * 1e-9
        if repeats_s > _FROZEN_S:
            text = f"{name} repeats one block for {repeats_s:.3g} s"
            found.append(Doubt("SENSOR_FROZEN", text, self._decides(name)))
        return found

    def _decides(self, name: str) -> bool:
        """Whether a verdict rests on a channel."""
        return {
            "drive_force_N": self._of.uses_force,
            "mass_position_m": self._of.uses_slide,
            "drive_position_m": True,
            "base_accel_mps2": self._same.vibrated,
            # by it the controller knows accelerometers that are swapped
            "mass_accel_mps2": math.isfinite(self._of.channels["mass_accel_mps2"].noise),
        }[name]
