"""`stickslip test`: run scenarios with expectations, or judge them on an old log."""

import os
from pathlib import Path
from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import STDOUT, Json, print_result
from cockpit.commands.options import SharedOptions, command, watched_share


@command("settings", "seed")
def run_tests(
    shared: SharedOptions,
    paths: Annotated[
        list[Path] | None,
        typer.Argument(
            metavar="[PATH]...", help=r"Scenarios with \[\[expect]], or folders; the shipped tests if not given."
        ),
    ] = None,
    jobs: Annotated[
        int | None, typer.Option(min=1, help="Processes to use; not given: all cores, or 1 with --rig.")
    ] = None,
    mutants: Annotated[
        bool,
        typer.Option("--mutants", help=r"Run with each defect of \[\[must_fail]], under which a test has to fail."),
    ] = False,
    rig: Annotated[
        str | None,
        typer.Option(
            "--rig", metavar="NAME", help="Rig in place of the scenarios' rigs: a name in deploy/rigs, or a .toml file."
        ),
    ] = None,
    arm: Annotated[
        bool, typer.Option("--arm", help="Arm a real rig for each scenario with arm = true; its exciter vibrates.")
    ] = False,
    log: Annotated[
        Path | None,
        typer.Option(metavar="OLD.mcap", help="Run nothing: judge the expectations on this log of any rig."),
    ] = None,
    logs: Annotated[
        Path, typer.Option(metavar="FOLDER", help="Folder for the logs of tests that did not pass.")
    ] = Path("runs/tests"),
    report: Annotated[Path | None, typer.Option("--junit", metavar="FILE.xml", help="Write JUnit XML.")] = None,
    page: Annotated[
        Path | None,
        typer.Option("--html", metavar="FILE.html", help="Write one offline page with a picture of each test."),
    ] = None,
    as_json: Json = None,
) -> int:
    """Run scenarios and judge their expectations; exit status 0: passed, 1: failed, 2: could not run, 14: not tested."""
    from bridge.files import write_whole
    from bridge.log.logfile import check_log_file
    from cockpit.run.child_process import end_like_ctrl_c
    from cockpit.run.scenario_file import deploy_folder
    from cockpit.run.writable import check_output, check_output_folder, writing
    from cockpit.testing.junit import junit
    from cockpit.testing.one import judge_old
    from cockpit.testing.page import page as page_of
    from cockpit.testing.suite import Suite, cases_of, mutants_of
    from cockpit.testing.suite import run_tests as run
    from cockpit.testing.target import Target

    end_like_ctrl_c()
    if report is not None:
        check_output("--junit", report, (".xml",))
    if page is not None:
        check_output("--html", page, (".html",))
    check_output_folder("--logs", logs)
    if log is not None and mutants:
        raise Fault("CONFIG", "--mutants: needs runs with defects, which --log does not have; leave one of them out")
    cases, others = cases_of(paths or [deploy_folder() / "tests"], shared.as_settings(), Target(rig or "", arm))
    without: list[str] = []
    if log is not None:
        check_log_file(log)
        tests = [judge_old(case, log) for case in cases]
    else:
        if mutants:
            cases, without = mutants_of(cases)
        jobs = jobs or (1 if rig else len(os.sched_getaffinity(0)))  # one test at a time uses a real rig
        with watched_share("testing", quiet=as_json == STDOUT) as progress:
            tests = run(cases, jobs, None if mutants else logs, progress)
    suite = Suite(tests, mutants, without, others)
    if report is not None:
        with writing(report):
            write_whole(report, junit(suite))
    if page is not None:
        with writing(page):
            write_whole(page, page_of(suite))
    suite = suite._replace(tests=[test._replace(picture="") for test in tests])  # JSON without pictures
    print_result(as_json, suite, suite.in_words(), indent=1)
    return suite.exit_status
