"""`stickslip replay`: is it the same, what if, and a log back on the bus."""

import json
import math
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bridge.config import validate, with_overrides
from bridge.faults import Fault
from bridge.log.logfile import RunData, read_run
from bridge.wire import stickslip_pb2 as wire
from cockpit.judge.verdict import judge_run
from cockpit.run.in_process import Word, run_onboard
from cockpit.run.run import about_run
from cockpit.run.scenario import Scenario, header
from controller.codes import RESET, STOP
from controller.config import ControllerConfig
from controller.replay import Change, Replay, replay

_LATEST_S = 1e9  # 32 years; a log counts nanoseconds in 64 bits, 1.8e10 s


def time_s(option: str, text: str, example: str) -> float:
    """The seconds of a time in an option. Raises Fault CONFIG."""
    try:
        t_s = float(text.removesuffix("s"))
    except ValueError:
        t_s = math.nan
    if not 0.0 <= t_s <= _LATEST_S:
        line = f"{option}: {text!r} is no time; must be from 0 to {_LATEST_S:g} s; write for example {example}"
        raise Fault("CONFIG", line)
    return t_s


def changes_of(run: RunData, settings: list[str]) -> list[Change]:
    """The log's own configuration, then every `key=value[@TIMEs]` setting from its time on. Raises Fault CONFIG."""
    recorded = table = run.configuration("controller")
    source = f"{run.path.name} with --set"
    timed: dict[int, list[str]] = {0: []}
    for setting in [*_timed_then(run), *settings]:
        plain, _, time = setting.rpartition("@")
        t_ns = 0
        if plain:
            t_ns = round(time_s(f"--set {setting}", time, "key=value@20s") * 1e9)
            end_ns = int(run.trace["t_ns"].max(initial=0))
            if t_ns > end_ns:
                line = f"--set {setting}: the log ends at {1e-9 * end_ns:g} s: must be a time before"
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


def _timed_then(run: RunData) -> list[str]:
    """What `--closed-loop` had set from a time on when it made this log; what it set from the start is in the header."""
    try:
        return [setting for setting in json.loads(run.headers.get("run", {}).get("settings", "[]")) if "@" in setting]
    except (ValueError, TypeError):
        line = f"{run.path}: the settings of its run are damaged; take another copy of the log"
        raise Fault("BAD_LOG", line) from None


def _words_of(run: RunData) -> list[Word]:
    """What the operator said, and when."""
    words = ((STOP, wire.Operator.STOP), (RESET, wire.Operator.RESET))
    return [Word(int(row["t_ns"]), action) for row in run.trace for bit, action in words if int(row["events"]) & bit]


def replay_logs(paths: list[Path], from_s: float, settings: list[str], as_json: bool) -> int:
    """Replay logs and say whether today's controller does the same; 0 when all are identical, 1 otherwise."""
    results: list[dict[str, Any]] = []
    for path in paths:
        run = read_run(path)
        if not len(run.trace):
            raise Fault("BAD_LOG", f"{path}: holds no trace: no controller was recorded, so nothing can be replayed")
        result = replay(run, changes_of(run, settings), from_s)
        if result.compared == 0:
            line = (
                f"{path}: no step from {from_s:g} s on can be rebuilt: the log ends before, or holds no usable snapshot"
            )
            raise Fault("BAD_LOG", f"{line}; use an earlier --from")
        results.append(_row(run, result, settings))
        if not as_json:
            print("\n".join(_lines(run, result, settings)))
    if as_json:
        print(json.dumps(results))
    return 0 if all(row["identical"] for row in results) else 1


def _row(run: RunData, result: Replay, settings: list[str]) -> dict[str, Any]:
    difference = result.difference._asdict() if result.difference else None
    return {
        "log": str(run.path),
        "identical": result.identical,
        "compared_steps": result.compared,
        "skipped_steps": result.skipped,
        "difference": difference,
        "likely_reason": "" if result.identical else likely_reason(run, settings),
    }


def _lines(run: RunData, result: Replay, settings: list[str]) -> list[str]:
    skipped = (
        f"; {result.skipped} steps could not be rebuilt, their block or the memory before them is not in the log"
        if result.skipped
        else ""
    )
    if result.difference is None:
        return [f"{run.path}: identical, {result.compared} steps, every command and trace in it bit for bit{skipped}"]
    d = result.difference
    lines = [
        f"{run.path}: differs from block {d.block} at {d.t_s:.3f} s on: {d.table}.{d.field} was {d.logged:.9g}, "
        f"is {d.replayed:.9g}{skipped}",
        f"  likely reason: {likely_reason(run, settings)}",
    ]
    if settings:
        lines.append(
            "  the log's plant heard the old commands: with these it would have answered differently from there on; "
            "--closed-loop simulates that"
        )
    return lines


def likely_reason(run: RunData, settings: list[str]) -> str:
    """Why a replay would differ, in words."""
    if settings:
        return f"the configuration was changed: {', '.join(settings)}"
    scenario = Scenario.model_construct(
        controller=validate(ControllerConfig, run.configuration("controller"), run.path.name)
    )
    was = json.loads(run.headers["controller"]["versions"])
    now = json.loads(header(scenario, "controller", lockstep=False).versions)
    changed = [f"{name} {was.get(name)} then, {now[name]} now" for name in now if was.get(name) != now[name]]
    if changed:
        return f"other versions: {'; '.join(changed)}"
    return "same versions and configuration: the controller's code was changed since, or the log was"


class RunFigures(NamedTuple):
    """What a run came to, for comparing two."""

    slips: int
    swing_N: float
    velocity_ratio_min: float
    drive_work_J: float
    vibration_dose_mm2_per_s: float  # integral of v_a squared


def outcome(run: RunData) -> RunFigures:
    """The figures of a run from its log."""
    verdict = judge_run(run)
    trace = run.trace
    block_s = float(run.configuration("controller")["block_s"])
    power_W = trace["drive_force_N"] * trace["drive_velocity_mps"]
    work_J = float(power_W[np.isfinite(power_W)].sum()) * block_s  # the verdict counts the blocks that are no number
    dose = float((trace["vibration_velocity_mps"] ** 2).sum()) * block_s * 1e6
    slips = int(trace["slips"][-1])
    swing_N = verdict.after.swing_N if verdict.after else 0.0
    return RunFigures(slips, swing_N, verdict.velocity_ratio_min, work_J, dose)


def closed_loop(path: Path, settings: list[str], log: Path, as_json: bool) -> int:
    """Simulate a log's run again, from its own plant and seed, with the changed controller, and compare both."""
    run = read_run(path)
    changes = changes_of(run, settings)
    plant = run.configuration("plant")
    missing = [key for key in ("rig", "seed") if key not in plant]
    if missing:
        line = f"{path}: its plant says nothing of {', '.join(missing)}: only the log of our own plant can be simulated again"
        raise Fault("BAD_LOG", line)
    if not len(run.sensors) or not len(run.trace):
        raise Fault("BAD_LOG", f"{path}: holds no block with what the controller did; there is nothing to compare with")
    # what was recorded, not what was planned: a run may have been interrupted, or have had no end
    table = {"rig": plant["rig"], "seed": plant["seed"], "duration_s": int(run.sensors["t_ns"][-1]) * 1e-9}
    table["controller"] = changes[0].config.model_dump(mode="json")
    scenario = validate(Scenario, table, path.name)
    about = about_run(scenario, lockstep=True) | {
        "closed_loop_of": str(path),
        "settings": [*_timed_then(run), *settings],
    }
    run_onboard(scenario, log, about, changes=changes[1:], words=_words_of(run))
    was, now = outcome(run), outcome(read_run(log))
    if as_json:
        print(json.dumps({"was": was._asdict(), "now": now._asdict(), "log": str(log)}))
        return 0
    print(f"{'':<28}{'as recorded':>14}{'changed':>14}")
    for field in RunFigures._fields:
        print(f"{field:<28}{getattr(was, field):>14.4g}{getattr(now, field):>14.4g}")
    print(f"log  {log}")
    return 0
