"""`stickslip run`: one scenario, one log, one verdict."""

import contextlib
import shutil
import sys
import time
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, NamedTuple

from bridge.faults import Fault
from bridge.log.storage.part_file import refuse_a_live_log
from bridge.log.storage.parts import parts_of
from bridge.log.storage.verdict_file import verdict_path
from bridge.plain import print_line
from bridge.results import strict_json
from bridge.units import counted
from bridge.wire.session import rig_security
from cockpit.run.child_process import left_on_ctrl_c, stop_event, warn_without_priority
from cockpit.run.run_tables import LogTable, refuse_for_processes
from cockpit.run.scenario import Scenario, load_scenario, refuse_short_blocks
from cockpit.run.writable import LOG, check_output, stamp_of

if TYPE_CHECKING:
    from cockpit.judge.judged import RunOutcome
    from cockpit.judge.phases import Phase
    from cockpit.judge.run_judge import RunJudge
    from cockpit.run.device_run import DeviceRun


# A run without an end in one process writes some 2 GB per minute. It ends when less disk space than this is free. Larger: it ends
# earlier. Smaller: the judging of the log and other programs meet a full disk.
_LEAST_FREE_BYTES = 1 << 30


def log_path(given: Path | None, name: str) -> Path:
    """Path of the log: `given`, or runs/NAME.mcap."""
    return given if given is not None else Path("runs") / f"{name}.mcap"


def keep_aside(path: Path) -> None:
    """Rename an existing log after the time at which it was written. Raises Fault LOG_WRITE."""
    if not path.is_file() or not path.stat().st_size:
        return
    refuse_a_live_log(path, "--log")
    written = time.strftime("%Y%m%d-%H%M%S", time.localtime(path.stat().st_mtime))
    aside, number = path.with_stem(f"{path.stem}-{written}"), 1
    while aside.exists():
        aside, number = path.with_stem(f"{path.stem}-{written}-{number}"), number + 1
    files = [*parts_of(path), *([verdict_path(path)] if verdict_path(path).exists() else [])]
    try:
        for file in files:  # run-0001.mcap becomes run-20261121-101500-0001.mcap
            file.rename(aside.with_name(aside.stem + file.name.removeprefix(path.stem)))
    except OSError as error:
        raise Fault("LOG_WRITE", f"{path}: cannot be renamed: {error.strerror}; choose another --log") from None
    print_line(f"kept     {aside} (the earlier {path.name})")


def about_run(scenario: "Scenario | DeviceRun", lockstep: bool) -> dict[str, object]:
    """Metadata that a log holds about its run, in addition to the configurations: names, seed and clock."""
    return {
        "scenario": scenario.name,
        "description": scenario.description,
        "rig": scenario.rig.name,
        "seed": scenario.seed,
        "clock": "lockstep" if lockstep else "realtime",
    }


def run_scenario(
    name: str,
    settings: list[str],
    lockstep: bool,
    in_process: bool,
    log: Path | None,
    wait_s: float | None = None,
    without: bool = False,
) -> "RunOutcome":
    """Run a scenario and judge it. Ctrl-C, SIGTERM or SIGHUP ends a run without an end, which is then judged like any other.

    `wait_s` is the longest time until the log of a run of several processes begins, None without a limit. `without`: after the
    run, also simulate it without the controller, for the judged stretch.

    Raises Fault INTERRUPTED if a run with an end was stopped before its end, and the fault that ended a run in one process early.
    In both cases the verdict on the recorded part is printed on stderr first.

    """
    scenario = _loaded(name, settings, in_process or without)
    path = log_path(log, scenario.name)
    check_output("--log", path, LOG)
    before = stamp_of(path)
    endless = scenario.duration_s == 0.0
    if isinstance(scenario, Scenario) and not (lockstep or in_process):
        refuse_short_blocks(scenario)
    if lockstep or not in_process:
        refuse_for_processes(scenario, lockstep)
    if not (lockstep or in_process):
        warn_without_priority()
    if not in_process:
        rig_security(scenario.bus)  # called here so that its warning is visible and its fault precedes every start
    if endless and in_process:
        _refuse_full_disk(path)
    if isinstance(scenario, Scenario) and scenario.expect:
        print_line(
            f"expect   `stickslip test {name}` judges the {counted(len(scenario.expect), 'expectation')}; a run does not"
        )
    if endless:
        print_line(f"{'simulating' if in_process else 'running'} until Ctrl-C; log {path}")
    interrupted, by, made = False, "Ctrl-C", _InProcessRun(None, [], stopped=False)
    try:
        if in_process and isinstance(scenario, Scenario):
            made = _in_process(scenario, path)
            interrupted = made.stopped
        else:
            from cockpit.run.processes import follower, run_processes

            arguments = ["--scenario", name, *(part for setting in settings for part in ("--set", setting))]
            follow = follower(scenario.bus, scenario.duration_s)
            run_processes(arguments, scenario.bus.endpoint, path, lockstep, follow, wait_s)
    except KeyboardInterrupt as ended:
        interrupted, by = True, str(ended) or by
    except Fault:
        if in_process and stamp_of(path) != before:
            _print_verdict(path)
        raise
    if interrupted and stamp_of(path) == before:
        raise Fault("INTERRUPTED", f"stopped by {by} before anything was recorded")
    closed = f"stopped by {by}; {path} is closed"
    left = f"{closed} and not judged; `stickslip log info {path}` judges it"
    line = f"judging the log; Ctrl-C {'again ' if interrupted else ''}to leave it unjudged"
    with left_on_ctrl_c(line, left, again=interrupted):
        return _judged(scenario, path, closed if interrupted else "", without, made)


def _loaded(name: str, settings: list[str], simulates: bool) -> "Scenario | DeviceRun":
    """The run; a real rig is refused for a run that `simulates`. Raises Fault CONFIG."""
    from cockpit.run.device_run import is_real, load_device_run

    return (
        load_device_run(name, settings)[0]
        if is_real(name, settings) and not simulates
        else load_scenario(name, settings)
    )


class _InProcessRun(NamedTuple):
    """Results of a run in one process, in addition to its log."""

    judge: "RunJudge | None"  # has received every message; None if the log must be read
    events: list[str]  # events that are not in the log: the run ended for lack of disk space
    stopped: bool  # the run was stopped by Ctrl-C or a signal


def _print_verdict(path: Path) -> None:
    """Write the verdict on the recorded part to stderr; nothing if the log holds no block."""
    from cockpit.judge.judged import judge
    from cockpit.judge.verdict_words import in_words

    with contextlib.suppress(Fault):
        verdict = judge(path)
        if verdict.blocks:
            print_line("\n".join(in_words(verdict, verbose=False)))


def _judged(
    scenario: "Scenario | DeviceRun", path: Path, interrupted: str, without: bool, made: _InProcessRun
) -> "RunOutcome":
    """Judge a run.

    Raises Fault INTERRUPTED with the line `interrupted`, if any, for a run that did not reach its end.
    """
    from bridge.log.damage import Damage
    from bridge.log.storage.checksums import checksums_of
    from bridge.log.storage.verdict_file import write_verdict
    from cockpit.judge.judged import RunOutcome, judge
    from cockpit.judge.setup import settled_from_s
    from cockpit.judge.verdict_words import in_words, noted

    if interrupted and scenario.duration_s:
        _print_verdict(path)
        raise Fault("INTERRUPTED", interrupted)
    closed = Damage(0, 0, closed=True)
    verdict = judge(path) if made.judge is None else made.judge.result(closed, checksums_of(path), {})
    if interrupted and not verdict.blocks:
        raise Fault("INTERRUPTED", f"{interrupted} and holds no block")
    verdict = verdict._replace(told=[*verdict.told, *made.events])
    alone = None
    if without and isinstance(scenario, Scenario) and verdict.after is not None:
        alone = _without_controller(scenario, settled_from_s(verdict.enabled_from_s), verdict.seconds)
    fields = noted(verdict) | ({"without": strict_json(alone)} if alone is not None else {})
    try:
        write_verdict(path, verdict.checksums.sha256, fields)
    except Fault:
        print_line("\n".join(in_words(verdict, verbose=False, without=alone)))
        raise
    effects = scenario.rig.effects if isinstance(scenario, Scenario) else []
    verdict = verdict._replace(checksums=verdict.checksums._replace(verdict="fits"))
    return RunOutcome(verdict, scenario.rig.name, list(effects), alone)


def _without_controller(scenario: Scenario, from_s: float, seconds: float) -> "Phase | None":
    """Simulate a run of `seconds` without vibration; return its figures from `from_s` on, None without a block. Raises Fault."""
    from cockpit.judge.judged import judge_log
    from cockpit.run.simulated.run import simulate

    policy = scenario.controller.policy.model_copy(update={"enabled_from_s": seconds + 1.0})
    controller = scenario.controller.model_copy(update={"policy": policy})
    log = LogTable(file_MB=0.0, file_s=0.0)
    alone = scenario.model_copy(update={"controller": controller, "duration_s": seconds, "log": log})
    with TemporaryDirectory() as folder:
        path = Path(folder) / "without.mcap"
        simulate(alone, path, {})
        return judge_log(path, stretch_from_s=from_s).judge.stretch


def _free_bytes(path: Path) -> int:
    """Free bytes on the disk that holds, or will hold, the log at `path`."""
    return shutil.disk_usage(next(parent for parent in path.absolute().parents if parent.exists())).free


def _refuse_full_disk(path: Path) -> None:
    """Raise Fault LOG_WRITE if a run without an end would end at once for lack of space."""
    if (free := _free_bytes(path)) < _LEAST_FREE_BYTES:
        line = f"{path}: {free / 1e6:.0f} MB are free: a run without an end in one process writes some 2 GB per minute"
        rule = f"and needs {_LEAST_FREE_BYTES / 1e6:.0f} MB"
        raise Fault(
            "LOG_WRITE", f"{line} {rule}; free space, choose another --log, or give it an end: --set duration_s=60"
        )


def _in_process(scenario: Scenario, path: Path) -> _InProcessRun:
    """Simulate, with a progress bar on a terminal. A run without an end shows the simulated time, until Ctrl-C or a full disk.

    A run without faults is judged while it is written. A run with faults is simulated message by message, with 0.4 s of CPU per
    simulated second instead of 0.01 s.
    """
    from rich.console import Console
    from rich.progress import Progress, TextColumn

    from cockpit.judge.run_judge import RunJudge
    from cockpit.run.in_process import run_onboard
    from cockpit.run.simulated.run import run_with_faults

    columns = (
        Progress.get_default_columns() if scenario.duration_s else (TextColumn("{task.completed:.1f} s simulated"),)
    )
    console = Console(stderr=True)
    if scenario.fault:
        print_line("simulating with faults, message by message: 0.4 s per simulated second, longer on a busy computer")
    judge = None if scenario.fault else RunJudge(path, {})
    with Progress(*columns, console=console, transient=True, disable=not sys.stderr.isatty()) as bar:
        task = bar.add_task("simulating", total=scenario.duration_s or None)
        stop = stop_event()
        about = about_run(scenario, lockstep=True)

        def is_full() -> bool:
            return scenario.duration_s == 0.0 and _free_bytes(path) < _LEAST_FREE_BYTES

        def stopped() -> bool:
            return stop.is_set() or is_full()

        def progress(t_s: float) -> None:
            bar.update(task, completed=t_s)

        if judge is None:
            run_with_faults(scenario, path, about, progress, stopped)
        else:
            run_onboard(scenario, path, about, progress, stopped=stopped, judge=judge)
    events = [f"LOG_WRITE: ended, as less than {_LEAST_FREE_BYTES / 1e6:.0f} MB are free for {path}"]
    return _InProcessRun(judge, events if is_full() else [], stop.is_set())
