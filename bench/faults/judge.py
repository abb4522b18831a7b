"""Judges one entry of the catalogue by the truth of its run: safe, SILENT or UNSAFE.

The truth is the rig's: v_a of its base, the velocity of its drive and of its slide, and nothing that the controller measures.
"""

import contextlib
from collections import Counter
from collections.abc import Callable
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bench.faults.truth import Truth, TruthRun
from bridge.faults import Fault
from bridge.log.in_charge import WEAK_S
from bridge.rig.faults.schedule import BEGAN, ENDED
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.event_codes import WEAK_REASONS
from bridge.wire.inbox import Received
from bridge.wire.messages import TRACE as TRACE_LAYOUT
from bridge.wire.payloads import sequence_and_time
from bridge.wire.topics import SENSORS, TRACE
from cockpit.expect.events import word_of
from cockpit.faults.catalogue import CatalogueEntry
from cockpit.run.in_process import TimedAction
from cockpit.run.scenario import Scenario, load_scenario

SAFE, SILENT, UNSAFE = "safe", "SILENT", "UNSAFE"
MOST_RATIO, MOST_S = 1.5, 0.2  # largest v_a over its set point, and longest total time above it
_ARM_S = 0.02  # time of the operator's command ARM
_MEMORY_S = 1.0  # the set point follows the fastest drive of this time: a vibration may outlast its move
_AT_REST_MPS = 1e-9  # v_a up to which the base is at rest; the rounding error at the end of a ramp is far below
_SLOWEST_MPS = 2e-5  # least set point of v_a; a smaller one would be noise
_SLIP_MPS = 0.01  # v_s from which the slide slips; in a slip of the paper's rig it reaches 22 mm/s
_LESS = 0.9  # share of the vibration without the fault below which the fault has an effect
# codes of events and causes of the guard that do not report a fault
_NOT_TOLD = {BEGAN, ENDED, "START", "END", "OPERATOR", "FRESH", "VIBRATION_BEGAN", "VIBRATION_ENDED", "RUN_ENDED"}


class Told(NamedTuple):
    """An event or reason, and the time from the begin of the fault to its first report [s]."""

    word: str
    after_s: float


class Outcome(NamedTuple):
    """The result of one entry."""

    group: str
    name: str
    about: str
    verdict: str
    why: str
    peak_ratio: float  # largest v_a over its set point
    above_s: float  # total time above 1.5 times its set point
    zero_after_s: float | None  # from the fault's begin to the end of the vibration; None: it does not end
    slips: int  # number of slips after the fault's begin
    told: list[Told]
    told_as: Told | None  # first event or reason that names the fault, if in time
    open: str  # known verdict of the entry, if not safe

    @property
    def as_known(self) -> bool:
        """Whether the verdict is not worse than the known one."""
        order = (SAFE, SILENT, UNSAFE)
        return order.index(self.verdict) <= order.index(self.open or SAFE)


class Happened(NamedTuple):
    """Figures of one run, from the begin of its fault."""

    truth: Truth
    told: list[Told]
    peak_ratio: float
    above_s: float
    zero_after_s: float | None
    slips: int
    share: float  # median of v_a over its set point


def judge(case: CatalogueEntry) -> Outcome:
    """Run one entry in simulated time and judge it. Raises Fault CONFIG for an invalid scenario."""
    ran = happened(case, with_faults=True)
    told_as = next((word for word in ran.told if word.word in case.told and word.after_s <= case.entry.within_s), None)
    verdict, why = _verdict(case, ran, told_as)
    return Outcome(
        group=case.group,
        name=case.entry.name,
        about=case.entry.about,
        verdict=verdict,
        why=why,
        peak_ratio=ran.peak_ratio,
        above_s=ran.above_s,
        zero_after_s=ran.zero_after_s,
        slips=ran.slips,
        told=ran.told,
        told_as=told_as,
        open=case.entry.open,
    )


def _verdict(case: CatalogueEntry, ran: Happened, told_as: Told | None) -> tuple[str, str]:
    if ran.above_s > MOST_S:
        return UNSAFE, f"v_a above {MOST_RATIO:g} times its set point for {ran.above_s:.2f} s"
    due_s = case.entry.zero_s
    if due_s is not None and (ran.zero_after_s is None or ran.zero_after_s > due_s):
        after = f"after {ran.zero_after_s:.2f} s" if ran.zero_after_s is not None else "to the end"
        return UNSAFE, f"nothing may vibrate after {due_s:g} s; it does {after}"
    if told_as is not None:
        return SAFE, "told"
    if case.told:
        wrong = f"; reported: {', '.join(word.word for word in ran.told)}" if ran.told else ""
        return SILENT, f"no report of the fault within {case.entry.within_s:g} s{wrong}"
    without = _healthy(case.model_copy(update={"entry": _key(case), "told": []}).model_dump_json())
    lost: list[str] = []
    if ran.slips > without.slips:
        lost.append(f"{ran.slips} slips in place of {without.slips}")
    if ran.share < _LESS * without.share:
        lost.append(f"v_a {ran.share:.2f} of its set point in place of {without.share:.2f}")
    if not lost:
        return SAFE, "without effect"
    return SILENT, "; ".join(lost)


def _key(row: CatalogueEntry) -> Any:
    """The entry without its fault: the key of the run for comparison, which several entries share."""
    return row.entry.model_copy(update={"name": "", "about": "", "fault": [], "told": None, "open": "", "zero_s": None})


@lru_cache(maxsize=16)
def _healthy(key: str) -> Happened:
    return happened(CatalogueEntry.model_validate_json(key), with_faults=False)


def happened(
    case: CatalogueEntry, with_faults: bool, make: Callable[[Scenario, list[TimedAction]], TruthRun] = TruthRun
) -> Happened:
    """Run one entry in simulated time; `make` creates the run. Raises Fault CONFIG for an invalid scenario."""
    entry = case.entry
    seconds = entry.begin_s + entry.watch_s
    scenario = load_scenario(entry.scenario, [*case.settings, f"duration_s={seconds}"])
    faults = [
        table.model_copy(update={"name": table.name or entry.name, "from_s": entry.begin_s + table.from_s})
        for table in entry.fault
    ]
    scenario = scenario.model_copy(update={"arm": not entry.checked} | ({"fault": faults} if with_faults else {}))
    words = [
        TimedAction(round((entry.begin_s + word.at_s) * 1e9), wire.Operator.Action.Value(word.word))
        for word in entry.said
    ]
    if entry.checked:
        words.append(TimedAction(round(_ARM_S * 1e9), wire.Operator.ARM))
    run = make(scenario, words)
    ear = _Ear(entry.begin_s, scenario.controller.block_s)
    run.listen(ear)
    run.play()
    truth = run.truth
    words_heard = ear.told()
    words_heard += [Told(fault.kind.code, 0.0) for fault in run.ended.values()]
    after = truth.t_s > entry.begin_s
    block_s = scenario.rig.solver.block_s
    fastest_mps = _fastest(np.abs(truth.drive_mps), round(_MEMORY_S / block_s))
    wanted_mps = np.maximum(scenario.controller.limits.v_ratio * fastest_mps, _SLOWEST_MPS)
    ratio = (truth.vibration_mps / wanted_mps)[after]
    vibrates = np.flatnonzero(truth.vibration_mps[after] > _AT_REST_MPS)
    ends = entry.begin_s + entry.watch_s - block_s
    last_s = float(truth.t_s[after][vibrates[-1]]) if len(vibrates) else entry.begin_s
    fast = np.abs(truth.slide_mps) > _SLIP_MPS
    began = fast & ~np.concatenate([[False], fast[:-1]])
    return Happened(
        truth,
        words_heard,
        peak_ratio=float(ratio.max(initial=0.0)),
        above_s=float(np.count_nonzero(ratio > MOST_RATIO)) * block_s,
        zero_after_s=last_s - entry.begin_s if last_s < ends else None,
        slips=int(np.count_nonzero(began & after)),
        share=float(np.median(ratio)) if len(ratio) else 0.0,
    )


def _fastest(values: npt.NDArray[np.float64], width: int) -> npt.NDArray[np.float64]:
    """Largest of each value and the `width` - 1 values before it."""
    padded = np.concatenate([np.zeros(width - 1), values])
    return np.lib.stride_tricks.sliding_window_view(padded, width).max(axis=1)


class _Ear:
    """Collects reports of a run from the begin of its fault: events, the causes in them, and reasons that last."""

    def __init__(self, begin_s: float, block_s: float) -> None:
        self._begin_ns = round(begin_s * 1e9)
        self._weak = {wire.Reason.Value(name): name for name in WEAK_REASONS}
        self._lasting = round(WEAK_S / block_s)
        self._reasons: Counter[int] = Counter()
        self._first: dict[str, float] = {}
        self._next_block = 0

    def __call__(self, received: Received) -> None:
        with contextlib.suppress(Fault):  # invalid messages
            self._hear(received)

    def _hear(self, received: Received) -> None:
        if received.arrival_ns < self._begin_ns:
            return
        after_s = (received.arrival_ns - self._begin_ns) * 1e-9
        if received.topic is TRACE:
            reason = int(np.frombuffer(received.payload, TRACE_LAYOUT.dtype)["reason"][0])
            if reason in self._weak:
                self._reasons[reason] += 1
                if self._reasons[reason] == self._lasting:
                    self._first.setdefault(self._weak[reason], after_s)
        elif received.topic is SENSORS:
            number, _ = sequence_and_time(received.payload, SENSORS.message)
            if number > self._next_block > 0:
                self._first.setdefault("GAP", after_s)  # as the recorder reports it
            self._next_block = max(self._next_block, number + 1)
        elif received.topic.message is wire.Event:
            event = wire.Event.FromString(received.payload)
            word = word_of(event)
            if word not in _NOT_TOLD:
                self._first.setdefault(word, after_s)

    def told(self) -> list[Told]:
        """Each event, cause or reason once, with the time of its first report, in this order."""
        return [Told(word, after_s) for word, after_s in self._first.items()]


def refused(case: CatalogueEntry, fault: Fault) -> Outcome:
    """The outcome of an entry whose run could not be made."""
    entry = case.entry
    why = f"not run: {fault.line}"
    return Outcome(case.group, entry.name, entry.about, UNSAFE, why, 0.0, 0.0, None, 0, [], None, entry.open)
