"""One scenario with one subject, from the start to the end, judged stretch by stretch so that hours need no memory."""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bench.control import record, rules
from bench.control.answer import end_stroke
from bench.control.loop import Hum, JudgedLoop
from bench.control.scenario import BankScenario
from bench.control.watch import watch
from bridge.wire import stickslip_pb2 as wire
from cockpit.run.closed_loop import Pair, Stretch
from plant.config import RigConfig
from plant.loop_delay import whole_blocks

_STRETCH_S = 1.0  # length of a stretch
_MOST_EVENTS = 20_000  # most events of a stretch; further events overwrite the last
_KEPT_STRETCHES = 4  # most stretches with a failure that are kept as curves
_COARSE_S = 0.05  # least time between the points of the curve of the whole run
_MOST_COARSE = 4000  # most points of this curve


class Subject(NamedTuple):
    """The subject of a run: the controller, a rival, or a constant ratio."""

    rule: int
    ratio: float = 1.2
    ahead_s: float = 0.0  # time by which an oracle knows v_d before its command acts; below 0: it knows the present v_d

    @property
    def name(self) -> str:
        """Name of the subject in the table."""
        return rules.NAMES[self.rule]


class Curves(NamedTuple):
    """Truth and traces of a part of a run, one row for each block, or for every n-th; columns as `record.BLOCK_ROWS`."""

    begin_s: float
    step_s: float
    rows: npt.NDArray[np.float32]


class Judged(NamedTuple):
    """The record of a run: events, sums over time, the first time of each reason, and curves around failures."""

    duration_s: float
    events: npt.NDArray[np.float64]
    sums: dict[str, float]
    reasons: dict[str, tuple[float, float, float]]  # time of run, motion, vibration until each reason
    loop_delay_s: float
    coarse: Curves
    kept: list[Curves]
    broken: bool  # the rig's state became NaN or infinite


def judge(
    scenario: BankScenario,
    subject: Subject,
    ends_at_slip_from_s: float = math.inf,
    keep_at_s: float = -1.0,
    observe: Callable[[Stretch], None] = lambda _: None,
) -> Judged:
    """Run a scenario and judge it. Raises Fault CONFIG where the controller refuses the scenario.

    Args:
        ends_at_slip_from_s: the run ends at the first slip or surge after this time.
        keep_at_s: time whose curves are kept in any case; below 0: none.
        observe: called with the messages of each stretch of the run.

    """
    rig, bank = scenario.rig, scenario.bank
    limits: dict[str, Any] = scenario.table["controller"].get("limits", {})
    enabled_from_s = scenario.enabled_from_s
    velocity_max_mps = float(limits.get("velocity_max_mps", 5e-3))
    forbidden = [(float(low), float(high)) for low, high in limits.get("forbidden_Hz", [(4600.0, 5000.0)])]
    candidates_Hz = rules.frequencies_Hz(rig, forbidden)
    if subject.rule == rules.CONSTANT:
        candidates_Hz = [rules.frequency_Hz(rig, candidates_Hz)]
    if subject.rule == rules.ORACLE:
        candidates_Hz = [rules.frequency_Hz(rig, candidates_Hz, subject.ratio)]
    rule = rules.build(subject.rule, rig, enabled_from_s, velocity_max_mps, candidates_Hz, subject.ratio)
    controls = scenario.scenario().controller if subject.rule == rules.CONTROLLER else rule
    hum = Hum(bank.hum.frequency_Hz, bank.hum.force_N, bank.hum.position_m)
    loop = JudgedLoop(rig, scenario.seed, controls, hum, _sees_blocks(rig, subject))
    blind = dict(wire.Reason.items()).get("BLIND", -1)
    of_judge = record.build(rig, scenario.slowest_mps, enabled_from_s, velocity_max_mps, blind)
    return _to_the_end(scenario, loop, of_judge, ends_at_slip_from_s, keep_at_s, observe)


def _sees_blocks(rig: RigConfig, subject: Subject) -> tuple[int, int]:
    """First and last block, in blocks from now: a rule that knows the truth vibrates for the largest |v_d| in them."""
    acts = 1 + whole_blocks(rig.loop.delay_s, rig.solver.block_s)
    if subject.rule != rules.ORACLE:
        return acts, acts
    return 0, 0 if subject.ahead_s < 0.0 else acts + math.ceil(subject.ahead_s / rig.solver.block_s)


def _to_the_end(
    scenario: BankScenario,
    loop: JudgedLoop,
    of_judge: Pair,
    ends_at_slip_from_s: float,
    keep_at_s: float,
    observe: Callable[[Stretch], None],
) -> Judged:
    block_s = scenario.rig.solver.block_s
    blocks = round(scenario.duration_s / block_s)
    stretch = max(round(_STRETCH_S / block_s), 1)
    room = np.empty((_MOST_EVENTS, record.EVENT_COLUMNS))
    rows = np.empty((stretch, len(record.BLOCK_ROWS)), np.float32)
    events: list[npt.NDArray[np.float64]] = []
    kept: list[Curves] = []
    coarse: list[npt.NDArray[np.float32]] = []
    every = max(round(_COARSE_S / block_s), math.ceil(blocks / _MOST_COARSE), 1)
    broken = slipped = False
    while loop.block < blocks and not broken and not slipped:
        begin = loop.block
        length = min(stretch, blocks - begin)
        made = loop.advance(length)
        observe(made)
        done = len(made.trace)
        broken = done < length
        count = watch(*of_judge, made.truth, made.v_a_mps, made.frequency_Hz, made.gain, made.trace, room, rows[:done])
        new = room[: min(count, len(room))].copy()
        events.append(new)
        slipped = bool(np.any(wrong_from(new, ends_at_slip_from_s)))
        coarse.append(rows[: done - done % every : every].copy())
        asked = begin <= keep_at_s / block_s < begin + done
        if asked or (len(kept) < _KEPT_STRETCHES and _worth_keeping(new, of_judge)):
            kept.append(Curves(begin * block_s, block_s, rows[:done].copy()))
    state: Any = of_judge[1][0]
    end_stroke(state)
    reasons = {
        wire.Reason.Name(number): tuple(
            float(state[name][number]) for name in ("reason_s", "reason_moving_s", "reason_excited_s")
        )
        for number in wire.Reason.values()
        if state.reason_s[number] >= 0.0
    }
    return Judged(
        loop.block * block_s,
        np.concatenate(events) if events else room[:0],
        {name: float(state[name]) for name in record.SUMS},
        reasons,  # pyright: ignore[reportArgumentType]
        scenario.rig.loop.longest_s(block_s) + block_s,
        Curves(0.0, every * block_s, np.concatenate(coarse)),
        kept,
        broken,
    )


def wrong_from(events: npt.NDArray[np.float64], from_s: float) -> npt.NDArray[np.bool_]:
    """Which events are slips or surges after a time; slips in a trial do not count."""
    return _fast(events) & (events[:, 1] > from_s) & (events[:, 5] != wire.PROBE)


def of_trials(events: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    """Which events are slips or surges in a trial without vibration."""
    return _fast(events) & (events[:, 5] == wire.PROBE)


def _fast(events: npt.NDArray[np.float64]) -> npt.NDArray[np.bool_]:
    return (events[:, 0] == record.SLIPPED) | (events[:, 0] == record.SURGED)


def _worth_keeping(events: npt.NDArray[np.float64], of_judge: Pair) -> bool:
    """Whether a slip or surge came while the controller was enabled, a stick was missed, or a false stick was claimed."""
    kinds = events[:, 0]
    missed = (kinds == record.STUCK) & (events[:, 5] < 0.0) & (events[:, 6] == 0.0)
    wrong = wrong_from(events, float(of_judge[0]["enabled_from_s"][0]))
    return bool(np.any((kinds == record.CLAIMED) | missed | wrong))
