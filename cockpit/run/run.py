"""`stickslip run`: one scenario, one log, one verdict."""

import contextlib
import json
import sys
import time
from pathlib import Path

from bridge.faults import Fault
from bridge.log.logfile import refuse_a_live_log
from cockpit.run.child_process import report
from cockpit.run.scenario import Scenario, load_scenario


def log_path(given: Path | None, name: str) -> Path:
    """Where a log goes."""
    return given if given is not None else Path("runs") / f"{name}.mcap"


def keep_aside(path: Path) -> None:
    """Give a log that is there already a name of its own, after the time it was written at. Raises Fault LOG_WRITE."""
    if not path.is_file() or not path.stat().st_size:
        return
    refuse_a_live_log(path, "--log")
    written = time.strftime("%Y%m%d-%H%M%S", time.localtime(path.stat().st_mtime))
    aside, number = path.with_stem(f"{path.stem}-{written}"), 1
    while aside.exists():
        aside, number = path.with_stem(f"{path.stem}-{written}-{number}"), number + 1
    try:
        path.rename(aside)
    except OSError as error:
        raise Fault("LOG_WRITE", f"{path}: cannot be renamed: {error.strerror}; choose another --log") from None
    print(f"kept     {aside}, which was {path.name} until now", file=sys.stderr)


def about_run(scenario: Scenario, lockstep: bool) -> dict[str, object]:
    """What a log says of its run besides the configurations."""
    return {
        "scenario": scenario.name,
        "description": scenario.description,
        "rig": scenario.rig.name,
        "seed": scenario.seed,
        "clock": "lockstep" if lockstep else "realtime",
    }


def _stamp(path: Path) -> tuple[int, int] | None:
    """Tells a file from what it was before; None where there is none."""
    if not path.is_file():
        return None
    now = path.stat()
    return now.st_mtime_ns, now.st_size


def run_scenario(
    name: str, settings: list[str], lockstep: bool, in_process: bool, log: Path | None, as_json: bool
) -> int:
    """Run a scenario and print its verdict; the exit status: 0 good, 1 when the run itself shows stick-slip or loss."""
    scenario = load_scenario(name, settings)
    path = log_path(log, scenario.name)
    before = _stamp(path)
    interrupted = False
    try:
        if in_process:
            from rich.console import Console
            from rich.progress import Progress

            from cockpit.run.in_process import run_onboard

            with Progress(console=Console(stderr=True), transient=True, disable=not sys.stderr.isatty()) as bar:
                task = bar.add_task("simulating", total=scenario.duration_s or None)
                run_onboard(
                    scenario, path, about_run(scenario, lockstep=True), lambda t_s: bar.update(task, completed=t_s)
                )
        else:
            from cockpit.run.processes import run_processes
            from cockpit.run.progress import follower

            arguments = ["--scenario", name, *(part for setting in settings for part in ("--set", setting))]
            run_processes(arguments, scenario.bus.endpoint, path, lockstep, follower(scenario.bus, scenario.duration_s))
    except KeyboardInterrupt:
        interrupted = True
    from bridge.log.logfile import read_run
    from cockpit.judge.verdict import headline, in_words, judge, judge_run

    if interrupted:
        if _stamp(path) == before:
            return report(Fault("INTERRUPTED", "stopped by Ctrl-C before anything was recorded"), as_json)
        with contextlib.suppress(Fault):  # a log of a moment may hold nothing to judge
            print("\n".join(in_words(judge(path))), file=sys.stderr)
        return report(Fault("INTERRUPTED", "stopped by Ctrl-C; the log is closed"), as_json)
    run = read_run(path)
    verdict = judge_run(run)
    table, lines = verdict.as_dict() | {"rig": scenario.rig.name}, [f"rig      {scenario.rig.name}"]
    if scenario.rig.effects:
        # another rig than the one the loop was designed for
        from cockpit.judge.margins import loop_margins, margins_in_words

        margins = loop_margins(run)
        table |= {"effects": list(scenario.rig.effects), "loop": margins.as_dict()}
        lines = [f"{lines[0]}, with {', '.join(scenario.rig.effects)}", *margins_in_words(margins)]
    print(json.dumps(table) if as_json else "\n".join([headline(verdict), *lines, *in_words(verdict)]))
    return 0 if verdict.good else 1
