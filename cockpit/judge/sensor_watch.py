"""Whether the sensors of a run can support a verdict: dead, clipped, swapped and absent channels, and three counts of slips.

Only the list of slip times grows with the run. A check without signals to compare has no finding.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.log.check.channel import FEW_AT_END, channel_findings
from bridge.log.check.log_check import LogWatch
from bridge.wire.channels import CHANNELS
from cockpit.judge.phases import Stretches, within
from cockpit.judge.relations import ChannelRelations, Doubt
from cockpit.judge.setup import Described
from cockpit.judge.slips import Forces
from cockpit.judge.watches import FrozenWatch
from cockpit.judge.window import Window

_FROZEN_S = 0.1  # longest allowed repetition of a block. Larger: a failure passes. Smaller: one doubled block counts
# Share of samples that are not finite above which a channel cannot support a verdict. Larger: slips may hide in these samples.
# Smaller: one dropout prevents the verdict on a long run.
_NOT_FINITE_SHARE = 1e-3
_CODES = {"not-finite": "SENSOR_ABSENT", "dead": "SENSOR_DEAD", "clipped": "SENSOR_CLIPPED"}


class SensorVerdict(NamedTuple):
    """Findings on the sensors, and three counts of slips."""

    findings: list[Doubt]
    by_force: int  # slips in the judged stretches, by the drive force
    by_position: int | None  # slips by both positions; None if these cannot show a slip
    by_trace: int  # slips and surges counted by the controller
    surges: int  # surges alone


class SensorWatch:
    """Checks the channels of one log, their repeated blocks, and window by window slips and relations."""

    def __init__(self, of: Described, log: LogWatch, frozen: FrozenWatch, block_s: float) -> None:
        self._of, self._log, self._frozen = of, log, frozen
        self._relations = ChannelRelations(of, block_s)
        self._least_N = self._least_m = 0.0  # smallest fall of force, and of drive less slide, counted in every window
        self._slips_s: dict[str, list[Floats]] = {"position": [], "slips": [], "surges": []}

    def add(self, window: Window, forces: Forces) -> None:
        """Add a window with its slips by force and by position."""
        self._relations.add(window)
        self._least_N, self._least_m = max(self._least_N, forces.least_N), max(self._least_m, forces.least_m)
        self._slips_s["position"].append(forces.by_position_s)
        trace, judged = window.trace, window.own(window.trace)
        for name in ("slips", "surges"):
            # a restarted controller counts from 0
            more = np.maximum(np.diff(trace[name], prepend=trace[name][:1]), 0)
            self._slips_s[name].append(np.repeat(trace["t_ns"][judged] * 1e-9, more[judged]))

    def result(self, force_slips_s: Floats, judged: Stretches) -> SensorVerdict:
        """Findings at the end of the log, with the slip times of the force; `judged`: stretches in which slips count."""
        of = self._of
        findings = [doubt for name in CHANNELS for doubt in self._of_channel(name)]
        broken = [doubt.text.partition(" ")[0] for doubt in findings]
        findings += [doubt for doubt in self._relations.doubts() if not any(name in doubt.text for name in broken)]
        slips_s = {name: np.concatenate([np.empty(0), *parts]) for name, parts in self._slips_s.items()}
        slips_s["force"] = force_slips_s
        in_log = {name: len(at_s) for name, at_s in slips_s.items()}
        inside = {name: int(within(at_s, judged).sum()) for name, at_s in slips_s.items()}
        # Surges do not decide: they occur at stops and turns as well. Nor does the controller alone: in the simulated axes of
        # docs/method/bank.md it counts up to 7 false slips.
        if of.uses_force and any(not by["force"] and by["position"] and by["slips"] for by in (inside, in_log)):
            text = "{force} by drive_force_N, {position} by the positions and {slips} by the controller"
            text = f"slips with the controller in charge: {text.format(**inside)}; in the whole log: {text.format(**in_log)}"
            findings.append(Doubt("SLIPS_DISAGREE", text, True))
        if of.uses_force and of.slip_m > 0.0 and of.fall_N < self._least_N < math.inf:
            text = f"drive_force_N is too noisy: it shows falls above {self._least_N:.3g} N only, and a slip is {of.fall_N:.3g} N"
            findings.append(Doubt("SENSOR_NOISE", text, True))
        by_position = inside["position"] if self._least_m < of.slip_m or in_log["position"] else None
        by_trace = inside["slips"] + inside["surges"]
        return SensorVerdict(findings, inside["force"], by_position, by_trace, inside["surges"])

    def _of_channel(self, name: str) -> list[Doubt]:
        seen, log, decides = self._log.signals[name].result(), self._log, self._decides(name)
        few = {"not-finite": _NOT_FINITE_SHARE * seen.samples, "clipped": FEW_AT_END}
        doubts = [
            Doubt(_CODES[finding.kind], f"{name} {finding.text}", decides)
            for finding in channel_findings(name, seen, log.sample_s, self._of.channels[name])
            if finding.times > few.get(finding.kind, 0)
        ]
        repeats_s = self._frozen.runs[name].longest * log.period_ns * 1e-9
        if repeats_s > _FROZEN_S:
            doubts.append(Doubt("SENSOR_FROZEN", f"{name} repeats one block for {repeats_s:.3g} s", decides))
        return doubts

    def _decides(self, name: str) -> bool:
        """True if the verdict depends on a channel."""
        return {
            "drive_force_N": self._of.uses_force,
            "mass_position_m": self._of.uses_slide,
            "drive_position_m": True,
            "base_accel_mps2": self._relations.vibrated,
            # the controller detects swapped accelerometers with it
            "mass_accel_mps2": math.isfinite(self._of.channels["mass_accel_mps2"].noise),
        }[name]
