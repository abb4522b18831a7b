"""`stickslip replay`: feed a log to this version's controller and compare, or simulate its run again with other settings."""

import contextlib
import math
import re
from pathlib import Path
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from bridge.config import validate, with_overrides
from bridge.faults import Fault
from bridge.guard.states import HOLD
from bridge.log.damage import damage_findings
from bridge.log.log_reader import LogReader
from bridge.log.logfile import Piece, RunData, check_log_file, iter_pieces, read_run
from bridge.log.metadata import configuration_of, table_of, texts_of
from bridge.units import counted
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import RESET, STOP
from cockpit.run.scenario_file import is_real_rig
from controller.config import ControllerConfig, looser_limits
from controller.replay import Change, OutOfOrder, Replay, ReplayDifference, Replayer, replay
from plant.config import RigConfig

if TYPE_CHECKING:
    from cockpit.run.in_process import TimedAction

Headers = dict[str, dict[str, str]]

_REPLAYED = frozenset({"sensors", "command", "trace", "announce", "snapshot"})  # topics that a replay needs
_ORDERS: dict[int, int] = {  # the order that leads to a cause of the guard
    wire.ARMED_BY_PERSON: wire.Operator.ARM,
    wire.DISARMED_BY_PERSON: wire.Operator.DISARM,
    wire.RESET_BY_PERSON: wire.Operator.RESET,
    wire.STOP_BY_PERSON: wire.Operator.STOP,
    wire.STOP_KEPT: HOLD,
}
_LATEST_S = 1e9  # 32 years; a log counts nanoseconds in 64 bits, 1.8e10 s


def time_s(option: str, text: str, example: str) -> float:
    """The time in an option, such as 12.5s, in seconds. Raises Fault CONFIG."""
    try:
        t_s = float(text.removesuffix("s"))
    except ValueError:
        t_s = math.nan
    if not 0.0 <= t_s <= _LATEST_S:
        line = f"{option}: {text!r} is not a time; must be from 0 to {_LATEST_S:g} s; write for example {example}"
        raise Fault("CONFIG", line)
    return t_s


def changes_of(run: RunData, settings: list[str]) -> list[Change]:
    """The controller's recorded configuration, and the one after each `key=value[@TIMEs]` setting. Raises Fault CONFIG."""
    return _changes_of(run.headers, run.path, settings, int(run.trace["t_ns"].max(initial=0)))


def _changes_of(headers: Headers, path: Path, settings: list[str], end_ns: int | None) -> list[Change]:
    """Changes as by `changes_of`, for a log that ends at `end_ns`; None if the end is not known yet."""
    recorded = table = configuration_of(headers, "controller", path)
    validate(ControllerConfig, recorded, path.name)  # checked before the settings, so that a fault names the log
    source = f"{path.name} with --set" if settings else path.name
    timed: dict[int, list[str]] = {0: []}
    for setting in [*_recorded_changes(headers, path), *settings]:
        plain, _, time = setting.rpartition("@")
        t_ns = 0
        if plain:
            t_ns = round(time_s(f"--set {setting}", time, "key=value@20s") * 1e9)
            if end_ns is not None and t_ns > end_ns:
                line = f"--set {setting}: the log ends at {1e-9 * end_ns:g} s: must be a time before; change the time"
                raise Fault("CONFIG", line)
        timed.setdefault(t_ns, []).append((plain or setting).removeprefix("controller."))
    changes: list[Change] = []
    for t_ns in sorted(timed):
        table = with_overrides(table, timed[t_ns])
        for name in ("block_s", "samples_per_block"):
            if table.get(name) != recorded.get(name):
                line = f"{source}: {name} = {table[name]}: must be {recorded.get(name)}, as recorded; leave it out"
                raise Fault("CONFIG", line)
        changes.append(Change(t_ns, validate(ControllerConfig, table, source)))
    return changes


def _recorded_changes(headers: Headers, path: Path) -> list[str]:
    """Settings `key=value@TIME` of the `--closed-loop` run that wrote this log; settings from the start are in the header."""
    return [setting for setting in texts_of(headers, "run", "settings", path) if "@" in setting]


def _commands_of(run: RunData) -> "list[TimedAction]":
    """Operator commands in a log, with their times: the controller's from its trace, the rig's from the causes of its guard."""
    from cockpit.run.in_process import TimedAction

    bits = ((STOP, wire.Operator.STOP), (RESET, wire.Operator.RESET))
    commands = [
        TimedAction(int(row["t_ns"]), action, to_rig=False)
        for row in run.trace
        for bit, action in bits
        if int(row["events"]) & bit
    ]
    began = run.applied[np.flatnonzero(np.diff(run.applied["cause"], prepend=0))]
    commands += [
        TimedAction(int(row["t_ns"]), _ORDERS[int(row["cause"])], to_controller=False)
        for row in began
        if int(row["cause"]) in _ORDERS
    ]
    return sorted(commands)


class Replayed(NamedTuple):
    """Result of feeding one log to this version's controller."""

    log: str
    identical: bool
    compared_steps: int
    skipped_steps: int  # steps that could not be rebuilt from the log
    difference: ReplayDifference | None
    likely_reason: str
    changed: bool  # a setting changed the controller
    damage: list[str]  # damage of the log; the damaged part was not replayed

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        skipped = (
            f"; {counted(self.skipped_steps, 'step')} could not be rebuilt: the log lacks a block or the memory before it"
            if self.skipped_steps
            else ""
        )
        damage = [f"  warning: {text}" for text in self.damage]
        if self.difference is None:
            same = f"identical, {counted(self.compared_steps, 'step')}, every command and trace bit for bit"
            return [f"{self.log}: {same}{skipped}", *damage]
        d = self.difference
        lines = [
            f"{self.log}: differs from block {d.block} at {d.t_s:.3f} s on: {d.table}.{d.field} was {d.logged:.9g}, "
            f"is {d.replayed:.9g}{skipped}",
            f"  likely reason: {self.likely_reason}",
            *damage,
        ]
        if self.changed:
            lines.append(
                "  the recorded plant received the recorded commands; with the new commands it would have moved differently: "
                "--closed-loop simulates this"
            )
        return lines


ReplayResult = list[Replayed]


def replay_log(path: Path, from_s: float, settings: list[str]) -> Replayed:
    """Replay one log from a time on, and compare it with this version's controller. Raises Fault BAD_LOG and CONFIG."""
    check_log_file(path)
    reader = LogReader(path)
    steps, end_ns, held, result = _one_pass(reader, from_s, settings)
    if not steps:
        raise Fault("BAD_LOG", f"{path}: holds no trace: no controller was recorded; replay another log")
    changes = _changes_of(reader.metadata, path, settings, end_ns)
    if result is None or held != changes:  # messages out of order, or a late configuration: read it all
        result = replay(read_run(path), changes, from_s)
    if result.compared == 0:
        line = f"{path}: no step from {from_s:g} s on can be rebuilt: the log ends before, or holds no usable snapshot"
        raise Fault("BAD_LOG", f"{line}; use an earlier --from")
    return Replayed(
        str(path),
        result.identical,
        result.compared,
        result.skipped,
        result.difference,
        "" if result.identical else likely_reason(reader.metadata, path, settings),
        bool(settings),
        [f"{finding.kind}: {finding.text}" for finding in damage_findings(reader.damage, path)],
    )


def _one_pass(
    reader: LogReader, from_s: float, settings: list[str]
) -> tuple[int, int, list[Change] | None, Replay | None]:
    """Replay a log while it is read, in constant memory, with the configuration before its first step.

    Returns the number of steps, the time of the last step, the configurations, and the result; result None if messages
    are out of order, or if the configuration is late.
    """
    steps = end_ns = 0
    changes, replayer = None, None
    waiting: list[Piece] = []  # pieces read before the controller's configuration
    out_of_order = False
    for piece in iter_pieces(reader, _REPLAYED):
        if piece.topic == "trace" and len(piece.records):
            steps += len(piece.records)
            end_ns = max(end_ns, int(piece.records["t_ns"].max()))
        if out_of_order:
            continue
        waiting.append(piece)
        try:
            if replayer is None and (steps or "controller" in reader.metadata):
                changes = _changes_of(reader.metadata, reader.path, settings, None)
                replayer = Replayer(changes, from_s)
            if replayer is not None:
                for earlier in waiting:
                    _add(replayer, earlier)
                waiting = []
        except (OutOfOrder, Fault):  # an incomplete configuration may become valid once the whole log is read
            out_of_order, replayer, waiting = True, None, []
    with contextlib.suppress(OutOfOrder):
        return steps, end_ns, changes, replayer.result() if replayer is not None else None
    return steps, end_ns, changes, None


def _add(replayer: Replayer, piece: Piece) -> None:
    if piece.topic == "snapshot":
        for snapshot in piece.messages:
            replayer.add_snapshot(snapshot)
    else:
        replayer.add(piece.topic, piece.records)


def likely_reason(headers: Headers, path: Path, settings: list[str]) -> str:
    """Likely reason for which a replay differs from its log, in words: settings, versions, or changed code."""
    from cockpit.run.run_tables import versions

    if settings:
        return f"the configuration was changed: {', '.join(settings)}"
    was, now = table_of(headers, "controller", "versions", path), versions()
    changed = [f"{name} {was.get(name)} then, {now[name]} now" for name in now if was.get(name) != now[name]]
    if changed:
        made, made_by = was.get("stickslip"), now["stickslip"]
        return f"other versions: {'; '.join(changed)}" + (f"; {_installed(str(made))}" if made != made_by else "")
    return "same versions and configuration: the controller's code or the log was changed since"


def _installed(version: str) -> str:
    """Instruction to install the version that wrote a log, with which the replay is identical."""
    if not re.fullmatch(r"[\w.+-]+", version, re.ASCII):
        return "the log does not name the version that wrote it"
    wheel = f"stickslip-{version}-py3-none-any.whl"
    return (
        f"after `pip install '{wheel}[all]'`, or `pip install '.[all]'` in a checkout of v{version}, it is repeated bit for bit; "
        "changed replays (`--set`, `--closed-loop`) work with this version"
    )


class RunFigures(NamedTuple):
    """Figures of a run, for the comparison of two runs."""

    slips: int  # counted by the controller
    swing_N: float  # swing of the drive force after hand-over
    velocity_ratio_min: float  # smallest v_a / v_d during vibration
    drive_work_J: float  # integral of drive force times drive velocity
    vibration_dose_mm2_per_s: float  # integral of v_a squared


def outcome(run: RunData) -> RunFigures:
    """The figures of a run from its log."""
    from cockpit.judge.judged import judge_tables

    verdict, _ = judge_tables(run)
    swing_N = verdict.after.swing_N if verdict.after else 0.0
    trace = run.trace
    block_s = float(run.configuration("controller")["block_s"])
    power_W = trace["drive_force_N"] * trace["drive_velocity_mps"]
    work_J = float(power_W[np.isfinite(power_W)].sum()) * block_s  # the verdict reports blocks with NaN or infinity
    dose = float((trace["vibration_velocity_mps"] ** 2).sum()) * block_s * 1e6
    return RunFigures(int(trace["slips"][-1]), swing_N, verdict.velocity_ratio_min, work_J, dose)


class Compared(NamedTuple):
    """A recorded run, and the same run simulated with the changed controller."""

    was: RunFigures
    now: RunFigures
    log: str  # log of the new run

    def in_words(self) -> list[str]:
        """A table for the operator."""
        rows = [
            f"{field:<28}{getattr(self.was, field):>14.4g}{getattr(self.now, field):>14.4g}"
            for field in RunFigures._fields
        ]
        return [f"{'':<28}{'as recorded':>14}{'changed':>14}", *rows, f"log  {self.log}"]


def closed_loop(path: Path, settings: list[str], log: Path) -> Compared:
    """Simulate the run of a log again, with its plant and seed and the changed controller, and compare both."""
    from cockpit.run.in_process import run_onboard
    from cockpit.run.run import about_run
    from cockpit.run.scenario import Scenario

    run = read_run(path)
    changes = changes_of(run, settings)
    plant = run.configuration("plant")
    missing = [key for key in ("rig", "seed") if key not in plant]
    if missing:
        line = f"{path}: the header of its plant lacks {', '.join(missing)}: must be a log of the simulated rig; choose another"
        raise Fault("BAD_LOG", line)
    if is_real_rig(plant["rig"]):
        raise Fault("BAD_LOG", f"{path}: is the log of a real rig: must be of a simulated rig; choose another")
    if "fault" in plant:
        line = (
            f"{path}: is the log of a run with faults, which are not repeated: must be of a run without; choose another"
        )
        raise Fault("BAD_LOG", line)
    if not len(run.sensors) or not len(run.trace):
        raise Fault(
            "BAD_LOG", f"{path}: holds no block with a trace of the controller to compare with; choose another log"
        )
    # the recorded duration, not the planned one: a run may have been interrupted, or have had no end
    table = {"rig": plant["rig"], "seed": plant["seed"], "duration_s": int(run.sensors["t_ns"][-1]) * 1e-9}
    table["step"] = [{"at_s": at_s, "load": load} for at_s, load in plant.get("loads", [])]
    # a rig without a guard counts as armed
    table["arm"] = int(run.sensors["guard_state"][0]) in {wire.NO_GUARD, wire.ARMED, wire.ACTIVE}
    table["controller"] = changes[0].config.model_dump(mode="json")
    if (
        "limits" not in plant
    ):  # a log before the controller took the rig's limits, which held its vibration then as well
        rig = validate(RigConfig, plant["rig"], path.name)
        for name in looser_limits(changes[0].config.limits, rig.vibration_limits):
            del table["controller"]["limits"][name]
    scenario = validate(Scenario, table, path.name)
    about = about_run(scenario, lockstep=True) | {
        "closed_loop_of": str(path),
        "settings": [*_recorded_changes(run.headers, path), *settings],
    }
    run_onboard(scenario, log, about, changes=changes[1:], words=_commands_of(run))
    return Compared(outcome(run), outcome(read_run(log)), str(log))
