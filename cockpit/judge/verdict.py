"""What came of a run, read from its log alone: in numbers for scripts and in words for a mechanic."""

import math
import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bridge.log.in_charge import GONE_S, WEAK_S, InCharge, in_charge
from bridge.log.logfile import RunData, read_run
from bridge.log.metadata import number_of
from bridge.log.storage.chain import Chain, chain_in_words
from bridge.units import counted
from bridge.wire import realtime
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.log_faults import of_bytes, of_clock, of_events
from cockpit.judge.pauses import Pauses, pauses_in, pauses_in_words
from diagnosis.features.cycles import Cycles, find_cycles

_SETTLING_S = 1.0  # after the controller is enabled it has this long
_ALARM_RATIO = 1.05
_RAMPED_DOWN = (wire.STALE_INPUT, wire.NOT_FINITE, wire.OPERATOR_STOP)
_STEADY_S, _STEADY_SHARE = 0.1, 0.1  # a drive that changed by less in this time moves evenly
_FADE_S = 0.2  # of the vibration at the end of a run
_CONTROLLED = ("drive_force_N", "mass_position_m", "base_accel_mps2", "drive_position_m")
_STANDSTILL_MPS = 2e-5  # the controller's own, unless it was set up otherwise
_BLOCKS = re.compile(r"\bblocks=(\d{1,18})\b")  # in the plant's END; a foreign rig need not say it
_RAMP_S = 0.15  # 40 ms of ramp at the default slew, and the measurement's filter behind it


class Phase(NamedTuple):
    """One stretch of a run."""

    seconds: float
    slips: int
    slips_per_min: float
    swing_N: float  # of the drive force, largest to smallest block mean
    mean_force_N: float


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
    after: Phase | None
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

    @property
    def good(self) -> bool:
        """Whether something was tested, stick-slip is gone while the controller is in charge, and nothing was lost.

        A machine that pauses for some 20 ms loses nothing: the controller ramps down and up again, which is told and no more.
        """
        gone = not self.untested and self.after is not None and self.after.slips == 0
        return gone and self.lost_blocks == 0 and not self.faults

    def as_dict(self) -> dict[str, Any]:
        """For `--json`."""
        table: dict[str, Any] = self._asdict() | {"good": self.good, "chain": self.chain.as_dict()}
        for name in ("before", "after", "alone", "charge", "latency", "pauses"):
            table[name] = table[name] and table[name]._asdict()
        return table


def judge(path: Path) -> RunVerdict:
    """Read a log and judge its run. Raises Fault BAD_LOG."""
    return judge_run(read_run(path))


def judge_run(run: RunData) -> RunVerdict:
    """Judge a run that was read."""
    controller = run.configuration("controller")
    block_s = number_of(controller, "block_s", run.path)
    enabled_from_s = number_of(controller, "policy.enabled_from_s", run.path)
    blocks = len(run.sensors)
    t_s = run.sensors["t_ns"] * 1e-9
    force_N = run.sensors["drive_force_N"].astype(np.float64)
    seconds = float(t_s[-1]) if blocks else 0.0
    began_s = max(float(t_s.min()) - block_s, 0.0) if blocks else 0.0  # a log may begin late
    in_charge_s = enabled_from_s + _SETTLING_S if enabled_from_s > 0 else 0.0
    samples = force_N.shape[1] if blocks else 1
    finite = np.isfinite(force_N).all(axis=1)
    unreadable = [name for name in _CONTROLLED if not np.isfinite(run.sensors[name]).all()]
    t_s, force_N = t_s[finite], force_N[finite]
    sample_s = (t_s[:, None] + (np.arange(samples) + 1 - samples) * (block_s / samples)).ravel()
    cycles = find_cycles(sample_s, force_N.ravel(), slowest_fall_s=_slowest_fall_s(run)) if len(t_s) else None
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
    after = _phase(cycles, t_s, mean_N, max(in_charge_s, began_s), seconds, without)
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
        alone=_alone(cycles, t_s, mean_N, gone),
        before=_phase(cycles, t_s, mean_N, began_s, min(enabled_from_s, seconds), []),
        after=after,
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
    )


def _is_steady(speed_mps: Any, block_s: float) -> Any:
    """Rows in which the drive moves as fast as 0.1 s before: while it turns, v_a over v_d says nothing."""
    back = round(_STEADY_S / block_s)
    steady = np.zeros(len(speed_mps), bool)
    changed_mps = np.abs(speed_mps[back:] - speed_mps[:-back])
    steady[back:] = (speed_mps[back:] > _STANDSTILL_MPS) & (changed_mps < _STEADY_SHARE * speed_mps[back:])
    return steady


def _alone(cycles: Cycles | None, t_s: Any, mean_N: Any, gone: list[tuple[float, float]]) -> Phase | None:
    """What happened while nobody was in charge."""
    phases = [_phase(cycles, t_s, mean_N, from_s, until_s, []) for from_s, until_s in gone]
    there = [phase for phase in phases if phase is not None]
    if not there:
        return None
    seconds, slips = sum(phase.seconds for phase in there), sum(phase.slips for phase in there)
    mean = sum(phase.mean_force_N * phase.seconds for phase in there) / seconds
    return Phase(seconds, slips, 60.0 * slips / seconds, max(phase.swing_N for phase in there), mean)


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


def _slowest_fall_s(run: RunData) -> float:
    """How long a slip may last: 1.6 times that of the plant's slide on its spring, and never less than 0.1 s."""
    if "plant" not in run.headers:
        return 0.1
    try:
        rig = run.configuration("plant")["rig"]
        return max(0.1, 3.0 * math.sqrt(rig["slide"]["mass_kg"] / rig["drive"]["stiffness_N_per_m"]))
    except (KeyError, TypeError, ValueError, ArithmeticError):  # another rig need not tell
        return 0.1


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
    whole = run.damage.whole
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


def _phase(
    cycles: Cycles | None, t_s: Any, mean_N: Any, from_s: float, to_s: float, without: list[tuple[float, float]]
) -> Phase | None:
    def counts(at_s: Any) -> Any:
        return ~sum(((at_s > first_s) & (at_s <= last_s) for first_s, last_s in without), np.zeros(len(at_s), bool))

    inside = (t_s > from_s) & (t_s <= to_s) & counts(t_s)
    if cycles is None or not inside.any():
        return None
    slips = int(np.count_nonzero(counts(cycles.between(from_s, to_s).breakaway_t_s)))
    seconds = to_s - from_s - sum(max(min(last_s, to_s) - max(first_s, from_s), 0.0) for first_s, last_s in without)
    # the first ramp of a run starts from an unloaded spring: no part of the swing of what follows
    later = inside & (t_s > min(from_s + 4.0, 0.5 * (from_s + to_s)))
    steady = later if later.any() else inside
    swing_N = float(np.ptp(mean_N[steady]))
    return Phase(seconds, slips, 60.0 * slips / seconds, swing_N, float(mean_N[steady].mean()))


def _latency(run: RunData) -> Latency | None:
    round_trip_ns = run.applied["round_trip_ns"][run.applied["commands"] > 0]
    round_trip_ns = round_trip_ns[round_trip_ns > 0]
    if not len(round_trip_ns):
        return None
    p50, p99, p999 = (float(value) * 1e-3 for value in np.percentile(round_trip_ns, [50, 99, 99.9]))
    in_time = int(run.applied["commands"].sum()) - int(run.applied["commands_late"].sum())
    # a command that never came is a late one; the last block's comes after the end
    return Latency(p50, p99, p999, min(in_time / max(len(run.applied) - 1, 1), 1.0))


def in_words(verdict: RunVerdict) -> list[str]:
    """The verdict as lines for a person."""
    v = verdict
    lines: list[str] = []
    if v.before is not None:
        lines.append(
            f"before   {counted(v.before.slips, 'slip')} in {v.before.seconds:.1f} s ({v.before.slips_per_min:.0f} per "
            f"minute of this phase), drive force swings by {v.before.swing_N:.2f} N"
        )
    if v.after is not None:
        lines.append(
            f"after    {counted(v.after.slips, 'slip')} in {v.after.seconds:.1f} s, drive force swings by {v.after.swing_N:.2f} N"
        )
    if v.alone is not None:
        lines.append(
            f"alone    {counted(v.alone.slips, 'slip')} in {v.alone.seconds:.2f} s with nobody in charge, drive force swings by "
            f"{v.alone.swing_N:.2f} N"
        )
    if v.stopped_s > _FADE_S:
        lines.append(
            f"stopped  by an operator, or not armed, for {v.stopped_s:.1f} s, which is no part of what came after"
        )
    if v.velocity_ratio_max > 0:
        low = "ok" if v.velocity_ratio_min >= _ALARM_RATIO else f"below {_ALARM_RATIO}: stick-slip may return"
        lines.append(f"v_a/v_d  {v.velocity_ratio_min:.2f} to {v.velocity_ratio_max:.2f} while vibrating ({low})")
    if v.latency is not None:
        latency = v.latency
        lines.append(
            f"latency  block to command p50 {latency.p50_us:.0f} us, p99 {latency.p99_us:.0f} us, p99.9 "
            f"{latency.p999_us:.0f} us; {100 * latency.within_1_ms:.2f} % within 1 ms"
        )
    lines.extend(pauses_in_words(v.pauses, v.not_watched))
    lost = "none lost" if v.lost_blocks == 0 else f"{v.lost_blocks} LOST"
    if not v.all_losses_known:
        lost = f"at least {lost}" if v.lost_blocks else "how many are lost is not known"
    also = f"; at least {counted(v.lost_messages, 'log message')} lost" if v.lost_messages else ""
    lines.append(f"blocks   {v.blocks}, {lost}{also}")
    if v.normal_scheduling:
        who = " and ".join(v.normal_scheduling)
        lines.append(f"priority {who} under {realtime.NORMAL}: {realtime.NOT_GUARANTEED}")
    lines.extend(f"warning  {fault}" for fault in [*v.faults, *v.told])
    lines.append(chain_in_words(v.chain))
    lines.append(f"log      {v.log}")
    return lines


def headline(verdict: RunVerdict) -> str:
    """The answer in one line."""
    v = verdict
    if v.alone is not None:
        why = ", then it was gone" if v.charge.controller_until_s is not None else ""
        slips = f"; {counted(v.alone.slips, 'slip')} with nobody in charge" if v.alone.slips else ""
        held_s = max(v.seconds - v.enabled_from_s - v.stopped_s - v.alone.seconds, 0.0)
        return f"the controller was in charge for {held_s:.2f} of {v.seconds:.2f} s only{why}{slips}"
    if v.untested or v.after is None:
        return v.untested
    tripped = next((fault for fault in v.faults if fault.startswith("FAULT: ")), None)
    if tripped is not None:
        return f"the rig's guard stopped the vibration: {tripped.removeprefix('FAULT: ')}"
    weak = f"; {', '.join(name for name, seconds in v.charge.reasons_s.items() if seconds > WEAK_S)}"
    weak = weak if len(weak) > 2 else ""
    if v.after.slips:
        return f"stick-slip is still there: {counted(v.after.slips, 'slip')} while the controller was in charge{weak}"
    if v.before is not None and v.before.slips:
        return f"stick-slip is gone: {counted(v.before.slips, 'slip')} before, none with the controller in charge{weak}"
    return f"no stick-slip with the controller in charge{weak}"
