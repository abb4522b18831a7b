"""Judges one case of deploy/faults by the truth of its run: safe, SILENT or UNSAFE.

Its [[expect]] are judged as by `stickslip test`, with the true amplitude of the base in place of the one in the log. The truth is
the rig's: v_a of its base, the velocity of its drive and of its slide, and nothing that the controller measures.
"""

from functools import lru_cache
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from bench.faults.truth import Truth, TruthRun
from bridge.faults import Fault
from bridge.log.logfile import RunData, read_run
from bridge.rig.faults.schedule import BEGAN, ENDED
from cockpit.expect.events import times_of
from cockpit.expect.judge import PASSED, Expected
from cockpit.expect.judge import judge as judge_expectations
from cockpit.expect.record import Record, Samples
from cockpit.faults.catalogue import CatalogueEntry
from cockpit.run.scenario import Scenario, load_scenario
from cockpit.run.simulated.run import run_with_faults

SAFE, SILENT, UNSAFE = "safe", "SILENT", "UNSAFE"
MOST_RATIO, MOST_S = 1.5, 0.2  # largest v_a over its set point, and longest total time above it
_MEMORY_S = 1.0  # the set point follows the fastest drive of this time: a vibration may outlast its move
_SLOWEST_MPS = 2e-5  # least set point of v_a; a smaller one would be noise
_SLIP_MPS = 0.01  # v_s from which the slide slips; in a slip of the paper's rig it reaches 22 mm/s
_LESS = 0.9  # share of the vibration without the fault below which the fault has an effect
# codes of events and causes of the guard that do not report a fault
_NO_REPORT = {
    *(BEGAN, ENDED, "START", "END", "OPERATOR", "FRESH", "VIBRATION_BEGAN", "VIBRATION_ENDED", "RUN_ENDED"),
    *("GUARD", "FAULT", "HELD_BACK"),
}
# known defects: cases that are not safe
KNOWN = {
    "base-accel-growing": SILENT,
    "base-accel-bursts": SILENT,
    "exciter-chattering-dead": SILENT,
    "two-exciter-twice-accel-half": UNSAFE,
    "two-exciter-1.6-accel-0.65": UNSAFE,
}


class Outcome(NamedTuple):
    """The result of one case."""

    group: str
    name: str
    about: str
    verdict: str
    why: str
    peak_ratio: float = 0.0  # largest v_a over its set point
    above_s: float = 0.0  # total time above 1.5 times its set point
    slips: int = 0  # number of slips after the fault's begin
    expectations: list[Expected] = []

    @property
    def known(self) -> str:
        """The worst verdict that was known before."""
        return KNOWN.get(self.name, SAFE)

    @property
    def as_known(self) -> bool:
        """Whether the verdict is not worse than the known one."""
        order = (SAFE, SILENT, UNSAFE)
        return order.index(self.verdict) <= order.index(self.known)


class Happened(NamedTuple):
    """Figures of one run, from the begin of its fault."""

    record: Record
    peak_ratio: float
    above_s: float
    slips: int
    share: float  # median of v_a over its set point


class _TrueRecord(Record):
    """A log whose amplitude is the true one, and whose events have their true times: a fault may change the time of the rig.

    A fault may also spoil the log, or prevent that a controller takes charge; a report counts all the same.
    """

    def __init__(self, run: RunData, truth: Truth, heard: dict[str, list[float]], block_s: float) -> None:
        super().__init__(run)
        t_s = truth.t_s
        self._amplitude = Samples(t_s, truth.amplitude_m, np.ones(len(t_s), bool), block_s)
        self.events = times_of(run) | heard
        self.damage = ""

    def charge_share(self, from_s: float, to_s: float) -> float:  # noqa: ARG002
        """All of the time."""
        return 1.0

    def samples(self, name: str) -> Samples | None:
        """Samples of a signal; None if the log does not contain it."""
        return self._amplitude if name == "amplitude_m" else super().samples(name)


def judge(case: CatalogueEntry) -> Outcome:
    """Run one case in simulated time and judge it; an invalid scenario is a finding, not a fault of the bench."""
    try:
        return _judged(case, load_scenario(case.scenario, []))
    except Fault as fault:
        return Outcome(case.group, case.name, case.about, UNSAFE, f"not run: {fault.line}")


def _judged(case: CatalogueEntry, scenario: Scenario) -> Outcome:
    ran = happened(TruthRun(scenario), begin_s(scenario))
    expected = judge_expectations(ran.record, scenario.expect)
    verdict, why = _verdict(scenario, ran, expected)
    return Outcome(
        case.group, case.name, case.about, verdict, why, ran.peak_ratio, ran.above_s, ran.slips, expectations=expected
    )


def begin_s(scenario: Scenario) -> float:
    """Time of the first fault or operator command other than ARM."""
    steps = [step.at_s for step in scenario.step if step.command != "ARM"]
    return min([*(fault.from_s for fault in scenario.fault), *steps])


def _verdict(scenario: Scenario, ran: Happened, expected: list[Expected]) -> tuple[str, str]:
    if ran.above_s > MOST_S:
        return UNSAFE, f"v_a above {MOST_RATIO:g} times its set point for {ran.above_s:.2f} s"
    for table, row in zip(scenario.expect, expected, strict=True):
        if row.result != PASSED:
            return SILENT if table.event else UNSAFE, row.in_words()
    if any(table.event for table in scenario.expect):
        return SAFE, "reported"
    healthy = {"fault": [], "expect": [], "name": "healthy", "description": ""}
    without = _healthy(scenario.model_copy(update=healthy).model_dump_json(), begin_s(scenario))
    lost: list[str] = []
    if ran.slips > without.slips:
        lost.append(f"{ran.slips} slips in place of {without.slips}")
    if ran.share < _LESS * without.share:
        lost.append(f"v_a {ran.share:.2f} of its set point in place of {without.share:.2f}")
    return (SILENT, "; ".join(lost)) if lost else (SAFE, "without effect")


@lru_cache(maxsize=16)
def _healthy(scenario: str, from_s: float) -> Happened:
    return happened(TruthRun(Scenario.model_validate_json(scenario)), from_s)


def happened(run: TruthRun, from_s: float) -> Happened:
    """Run in simulated time, and its figures from a time on."""
    scenario = run.scenario
    with TemporaryDirectory() as folder:
        log = Path(folder) / "run.mcap"
        run_with_faults(scenario, log, {}, run=run)
        block_s = scenario.rig.solver.block_s
        record = _TrueRecord(read_run(log), run.truth, run.heard, block_s)
    truth = run.truth
    after = truth.t_s > from_s
    fastest_mps = _fastest(np.abs(truth.drive_mps), round(_MEMORY_S / block_s))
    wanted_mps = np.maximum(scenario.controller.limits.v_ratio * fastest_mps, _SLOWEST_MPS)
    ratio = (truth.vibration_mps / wanted_mps)[after]
    fast = np.abs(truth.slide_mps) > _SLIP_MPS
    began = fast & ~np.concatenate([[False], fast[:-1]])
    return Happened(
        record,
        peak_ratio=float(ratio.max(initial=0.0)),
        above_s=float(np.count_nonzero(ratio > MOST_RATIO)) * block_s,
        slips=int(np.count_nonzero(began & after)),
        share=float(np.median(ratio)) if len(ratio) else 0.0,
    )


def reports(record: Record, from_s: float) -> list[str]:
    """Words of the log that report a fault from a time on."""
    words = (word for word, times_s in record.events.items() if times_s[-1] >= from_s)
    return sorted({*words} - _NO_REPORT)


def _fastest(values: npt.NDArray[np.float64], width: int) -> npt.NDArray[np.float64]:
    """Largest of each value and the `width` - 1 values before it."""
    padded = np.concatenate([np.zeros(width - 1), values])
    return np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=1)
