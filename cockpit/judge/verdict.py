"""What came of a run, read from its log alone, in numbers."""

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bridge.log.in_charge import GONE_S, InCharge, in_charge
from bridge.log.logfile import RunData, read_run
from bridge.log.metadata import number_of, source_of_import
from bridge.log.storage.chain import Chain
from bridge.units import counted
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.log_faults import of_bytes, of_clock, of_events
from cockpit.judge.machine_terms import motion_of
from cockpit.judge.pauses import Pauses, pauses_in
from cockpit.judge.phases import Phase, Told, alone, phase, slips_in
from cockpit.judge.slips import cycles_of, steady_parts_of

_SETTLING_S = 1.0  # after the controller is enabled it has this long
_RAMPED_DOWN = (wire.STALE_INPUT, wire.NOT_FINITE, wire.OPERATOR_STOP)
_STEADY_S, _STEADY_SHARE = 0.1, 0.1  # a drive that changed by less in this time moves evenly
_CONTROLLED = ("drive_force_N", "mass_position_m", "base_accel_mps2", "drive_position_m")
_STANDSTILL_MPS = 2e-5  # the controller's own, unless it was set up otherwise
_BLOCKS = re.compile(r"\bblocks=(\d{1,18})\b")  # in the plant's END; a foreign rig need not say it
_RAMP_S = 0.15  # 40 ms of ramp at the default slew, and the measurement's filter behind it


class Latency(NamedTuple):
    """Block out to its command in."""

    p50_us: float
    p99_us: float
    p999_us: float
    within_1_ms: float  # share


class RunVerdict(NamedTuple):
    """A run's figures."""

    log: str
    seconds: float
    blocks: int
    lost_blocks: int
    lost_messages: int  # at least: of blocks alone it is known how many there were
    all_losses_known: bool  # False: a log that is cut or damaged may lack more than it shows
    enabled_from_s: float
    stopped_s: float  # by an operator, and no part of `after`
    charge: InCharge  # when the rig was on its own, which is no part of `after` either, and blocks without an answer
    alone: Phase | None  # the rig on its own, for longer than a late command explains
    before: Phase | None
    taking_over: Phase | None  # the second that the controller has to settle, between `before` and `after`
    after: Phase | None
    stopped_slips: int  # in `stopped_s` and the second after it, which are no part of `after` either
    drive_velocity_max_mps: float  # as measured
    velocity_ratio_min: float
    velocity_ratio_max: float
    latency: Latency | None
    pauses: Pauses | None  # of the whole machine; None in lockstep, and where they were not watched
    not_watched: str  # why the machine's pauses are not known; empty where they are, and in lockstep
    faults: list[str]  # with each of these the run is not good
    told: list[str]  # what a person should know besides
    chain: Chain
    normal_scheduling: list[str]  # processes without a real-time priority; in lockstep none needs it
    untested: str  # why nothing was tested; empty where the drive moved with the controller in charge
    imported: str  # the file of another program that the log was made from; empty for a run
    gain_verified: bool  # of the exciter: by a loop check of the rig, or told by the configuration

    @property
    def good(self) -> bool:
        """Whether something was tested, stick-slip is gone while the controller is in charge, and nothing was lost.

        A machine that pauses for some 20 ms loses nothing: the controller ramps down and up again, which is told and no more.
        """
        if self.imported:  # there was nothing to test: the log tells what is there, whole
            return self.lost_blocks == 0 and not self.faults
        gone = not self.untested and self.after is not None and self.after.slips == 0
        return gone and self.lost_blocks == 0 and not self.faults

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        table: dict[str, Any] = self._asdict() | {"good": self.good, "chain": self.chain.as_dict()}
        for name in ("before", "taking_over", "after", "alone"):
            table[name] = table[name] and table[name].as_dict()
        for name in ("charge", "latency", "pauses"):
            table[name] = table[name] and table[name]._asdict()
        return table


def judge(path: Path) -> RunVerdict:
    """Read a log and judge its run. Raises Fault BAD_LOG."""
    return judge_run(read_run(path))


def stretch_of(run: RunData, from_s: float, to_s: float) -> Phase | None:
    """What happened in a stretch of a run; None where it has no block. Raises Fault BAD_LOG."""
    mean_N = run.sensors["drive_force_N"].astype(np.float64).mean(axis=1)
    finite = np.isfinite(mean_N)
    block_s = number_of(run.configuration("controller"), "block_s", run.path)
    t_s, part = run.sensors["t_ns"][finite] * 1e-9, steady_parts_of(run)[finite]
    told_by = Told(cycles_of(run), t_s, mean_N[finite], part, motion_of(run, block_s))
    return phase(told_by, from_s, to_s, [])


def judge_run(run: RunData) -> RunVerdict:
    """Judge a run that was read; of measured data of another program, say what is there. Raises Fault BAD_LOG."""
    if source := source_of_import(run.headers, run.path):
        return _judge_imported(run, source)
    controller = run.configuration("controller")
    block_s = number_of(controller, "block_s", run.path)
    enabled_from_s = number_of(controller, "policy.enabled_from_s", run.path)
    blocks = len(run.sensors)
    t_s = run.sensors["t_ns"] * 1e-9
    force_N = run.sensors["drive_force_N"].astype(np.float64)
    seconds = float(t_s[-1]) if blocks else 0.0
    began_s = max(float(t_s.min()) - block_s, 0.0) if blocks else 0.0  # a log may begin late
    in_charge_s = settled_from_s(enabled_from_s)
    finite = np.isfinite(force_N).all(axis=1)
    unreadable = [name for name in _CONTROLLED if not np.isfinite(run.sensors[name]).all()]
    t_s, force_N = t_s[finite], force_N[finite]
    cycles = cycles_of(run)
    mean_N = force_N.mean(axis=1)
    trace = run.trace
    stops = _stops(trace, block_s)
    excited = _vibrating(trace, block_s) & (trace["t_ns"] * 1e-9 > in_charge_s)
    speed_mps = np.abs(trace["drive_velocity_mps"])
    excited &= _is_steady(speed_mps, block_s)
    ratio = trace["vibration_velocity_mps"][excited] / speed_mps[excited]
    faults, told = of_events(run)
    charge = in_charge(run)
    for code, text, is_fault in charge.sentences():
        (faults if is_fault else told).append(f"{code}: {text}")
    if (clock := of_clock(run, block_s)) is not None:
        faults.append(clock)
    gone = [stretch for stretch in charge.stretches if stretch[1] - stretch[0] > GONE_S]
    for name in unreadable:
        bad = ~np.isfinite(run.sensors[name]).all(axis=1)
        many, first = counted(np.count_nonzero(bad), "block holds", "blocks hold"), run.sensors["sequence"][bad][0]
        faults.append(f"NOT_FINITE: /sensors {name}: {many} a sample that is no number, first {first}; left out")
    slips = trace["slips"].astype(np.int64)
    rose = np.diff(slips, prepend=slips[:1]) > 0
    unmoved = rose & (np.abs(trace["drive_velocity_mps"]) <= _STANDSTILL_MPS)
    if unmoved.any():
        first_s = float(trace["t_ns"][unmoved][0]) * 1e-9
        faults.append(
            f"DRIVE_UNSEEN: {counted(np.count_nonzero(unmoved), 'slip')} while the drive position stood, first at "
            f"{first_s:.3f} s: is its transducer at the end of its range, or loose?"
        )
    lost_blocks, all_losses_known = _lost_blocks(run)
    stopped_s = sum(min(until_s - _SETTLING_S, seconds) - from_s for from_s, until_s in stops)
    latency = _latency(run)
    pauses, why_not = pauses_in(run, block_s * 1e9) if latency is not None else (None, "")
    # the controller has its second to settle after it was gone as well
    without = [*stops, *((from_s, until_s + _SETTLING_S) for from_s, until_s in gone)]
    told_by = Told(cycles, t_s, mean_N, steady_parts_of(run)[finite], motion_of(run, block_s))
    after = phase(told_by, max(in_charge_s, began_s), seconds, without)
    gone_s = sum(until_s - from_s for from_s, until_s in gone)
    return RunVerdict(
        log=str(run.path),
        seconds=seconds,
        blocks=blocks,
        lost_blocks=lost_blocks,
        lost_messages=lost_blocks + sum(map(_lost, (run.applied, run.command, run.trace, run.state))),
        all_losses_known=all_losses_known,
        enabled_from_s=enabled_from_s,
        stopped_s=stopped_s,
        charge=charge,
        alone=alone(told_by, gone),
        before=phase(told_by, began_s, min(enabled_from_s, seconds), []),
        taking_over=phase(told_by, enabled_from_s, min(in_charge_s, seconds), without),
        after=after,
        stopped_slips=slips_in(cycles, stops),
        drive_velocity_max_mps=float(trace["drive_velocity_mps"].max(initial=0.0)),
        velocity_ratio_min=float(ratio.min()) if len(ratio) else 0.0,
        velocity_ratio_max=float(ratio.max()) if len(ratio) else 0.0,
        latency=latency,
        pauses=pauses,
        not_watched=why_not,
        faults=faults + [f"{finding.kind}: {finding.text}" for finding in of_bytes(run)],
        told=told,
        chain=run.chain,
        normal_scheduling=[
            event.source for event in run.events if event.code == "START" and event.text.startswith(realtime.NORMAL)
        ],
        untested=_untested(run, after, seconds - enabled_from_s - stopped_s - gone_s),
        imported="",
        gain_verified=_gain_is_verified(run),
    )


def settled_from_s(enabled_from_s: float) -> float:
    """From when on a controller that is enabled then is judged."""
    return enabled_from_s + _SETTLING_S if enabled_from_s > 0 else 0.0


def _gain_is_verified(run: RunData) -> bool:
    """Whether v_a is known from more than the accelerometer: one that was wrong from the start cannot be seen otherwise."""
    told = bool(run.configuration("controller").get("amplitude", {}).get("known_gain"))
    return told or bool(np.isin(run.applied["cause"], (wire.CHECK_PASSED, wire.GAIN_ACCEPTED)).any())


def _judge_imported(run: RunData, source: str) -> RunVerdict:
    """What is in measured data of another program: its slips and its swing; no controller was there to be judged."""
    blocks = len(run.sensors)
    t_s = run.sensors["t_ns"] * 1e-9
    mean_N = run.sensors["drive_force_N"].astype(np.float64).mean(axis=1)
    finite = np.isfinite(mean_N)
    seconds = float(t_s[-1]) if blocks else 0.0
    lost_blocks, all_losses_known = _lost_blocks(run)
    told_by = Told(cycles_of(run), t_s[finite], mean_N[finite], steady_parts_of(run)[finite], None)
    return RunVerdict(
        log=str(run.path),
        seconds=seconds,
        blocks=blocks,
        lost_blocks=lost_blocks,
        lost_messages=lost_blocks,
        all_losses_known=all_losses_known,
        enabled_from_s=seconds,
        stopped_s=0.0,
        charge=in_charge(run),
        alone=None,
        before=phase(told_by, 0.0, seconds, []),
        taking_over=None,
        after=None,
        stopped_slips=0,
        drive_velocity_max_mps=0.0,
        velocity_ratio_min=0.0,
        velocity_ratio_max=0.0,
        latency=None,
        pauses=None,
        not_watched="",
        faults=[f"{finding.kind}: {finding.text}" for finding in of_bytes(run)],
        told=[],
        chain=run.chain,
        normal_scheduling=[],
        untested="measured data of another program: no controller was there to be judged",
        imported=source,
        gain_verified=True,
    )


def _is_steady(speed_mps: Any, block_s: float) -> Any:
    """Rows in which the drive moves as fast as 0.1 s before: while it turns, v_a over v_d says nothing."""
    back = round(_STEADY_S / block_s)
    steady = np.zeros(len(speed_mps), bool)
    changed_mps = np.abs(speed_mps[back:] - speed_mps[:-back])
    steady[back:] = (speed_mps[back:] > _STANDSTILL_MPS) & (changed_mps < _STEADY_SHARE * speed_mps[back:])
    return steady


def _untested(run: RunData, after: Phase | None, in_charge_s: float) -> str:
    """Why nothing was tested, in words; empty where something was. `in_charge_s`: time of the controller, its settling too."""
    if not len(run.sensors):
        return "no block was recorded"
    if not len(run.trace):
        return "no step of a controller was recorded: nothing was tested"
    if (run.trace["reason"] == wire.NOT_ARMED).all():
        return "the rig was never armed: `stickslip arm`, or `arm = true` in the scenario of a simulated rig"
    if not (np.abs(run.trace["drive_velocity_mps"]) > _STANDSTILL_MPS).any():
        return "the drive never moved: nothing was tested"
    if after is not None:
        return ""
    if in_charge_s <= 0.0 or not (run.applied["fallback"] == 0).any():
        return "the controller was not in charge in this run"
    why = f"too short to judge: it has {_SETTLING_S:g} s to settle"
    if in_charge_s > _SETTLING_S:  # the force is no number, or the operator left it no second to settle in
        why = "but nothing there can be judged"
    return f"the controller was in charge for {in_charge_s:.2g} s, {why}"


def _stops(trace: Any, block_s: float) -> list[tuple[float, float]]:
    """When an operator had stopped the controller, or the rig was not armed, and until it was in charge again; in s."""
    idle = (trace["mode"] == wire.STOPPED) | (trace["reason"] == wire.NOT_ARMED)
    stopped = np.concatenate([[False], idle, [False]])
    starts, ends = np.flatnonzero(np.diff(stopped.astype(int))).reshape(-1, 2).T
    t_s = trace["t_ns"] * 1e-9
    return [(t_s[start] - block_s, t_s[end - 1] + _SETTLING_S) for start, end in zip(starts, ends, strict=True)]


def _vibrating(trace: Any, block_s: float) -> Any:
    """Rows in EXCITE with a measurement of their own, but for the ramp before them, when v_a is on its way up."""
    excited = (trace["mode"] == wire.EXCITE) & ~np.isin(trace["limit"], _RAMPED_DOWN)
    starts = np.where(excited & ~np.concatenate([[False], excited[:-1]]), np.arange(len(excited)), 0)
    since = np.arange(len(excited)) - np.maximum.accumulate(starts)
    return excited & (since * block_s > _RAMP_S)


def _lost_blocks(run: RunData) -> tuple[int, bool]:
    """Blocks that are not in the log, and whether it tells of all.

    A damaged chunk may hold the first blocks or the last ones: then the plant's END counts, which says how many there were.
    """
    numbers = _numbers(run.sensors)
    whole = run.damage.whole and not run.damage.before
    ends = [_BLOCKS.search(event.text) for event in run.events if (event.source, event.code) == ("plant", "END")]
    told = [int(found[1]) for found in ends if found]
    if not told:
        return _lost(run.sensors), whole
    first = int(numbers[0]) if whole and len(numbers) else 0  # a recorder may have come late
    end = max(told[-1], int(numbers[-1]) + 1 if len(numbers) else 0)
    return end - first - len(numbers), True


def _lost(table: Any) -> int:
    """Messages that are missing between the first and the last number, whatever the order they came in."""
    if not len(table):
        return 0
    numbers = _numbers(table)
    return int(numbers[-1] - numbers[0] + 1 - len(numbers))


def _numbers(table: Any) -> Any:
    """The numbers of messages, ascending, each once."""
    numbers = np.sort(table["sequence"].astype(np.int64), kind="stable")
    return numbers[np.concatenate([[True], numbers[1:] > numbers[:-1]])[: len(numbers)]]


def _latency(run: RunData) -> Latency | None:
    round_trip_ns = run.applied["round_trip_ns"][run.applied["commands"] > 0]
    round_trip_ns = round_trip_ns[round_trip_ns > 0]
    if not len(round_trip_ns):
        return None
    p50, p99, p999 = (float(value) * 1e-3 for value in np.percentile(round_trip_ns, [50, 99, 99.9]))
    in_time = int(run.applied["commands"].sum()) - int(run.applied["commands_late"].sum())
    # a command that never came is a late one; the last block's comes after the end
    return Latency(p50, p99, p999, min(in_time / max(len(run.applied) - 1, 1), 1.0))
