"""`stickslip log info`: the verdict on the run in a log and the findings of its check; for several logs one line each."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import STDOUT, Json, carry_out, print_result
from cockpit.commands.options import Strict, Verbose, watched_share
from cockpit.run.child_process import ReportedFault

if TYPE_CHECKING:
    from cockpit.judge.judged import Judged

_WORST_FIRST = (7, 1, 14, 0)  # exit statuses: no log, not ok, not judged, ok


def log_info(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Run logs, .mcap; for several a line each.")],
    verbose: Verbose = False,
    strict: Strict = False,
    as_json: Json = None,
) -> None:
    """Judge the run in a log, and check the log; exit status 0 ok, 1 not ok, 14 not judged, 7 no log; of several the worst."""

    def work() -> int:
        quiet = as_json == STDOUT
        if len(logs) == 1:
            judged = _judged(logs[0], quiet)
            print_result(as_json, judged, _in_words(judged, verbose, strict))
            return judged.verdict.exit_status(strict)
        rows = [_row(path, quiet, strict) for path in logs]
        print_result(as_json, [result for _, _, result in rows], [line for _, line, _ in rows])
        return min((status for status, _, _ in rows), key=_WORST_FIRST.index)

    carry_out(work, as_json)


def _judged(path: Path, quiet: bool) -> "Judged":
    from cockpit.judge.judged import judge_log

    with watched_share(f"judging {path.name}", quiet=quiet) as progress:
        return judge_log(path, progress)


def _row(path: Path, quiet: bool, strict: bool) -> "tuple[int, str, Judged | ReportedFault]":
    """Exit status, line and result of one log of several; a file that is not a log does not end the work on the others."""
    try:
        judged = _judged(path, quiet)
    except Fault as fault:
        if fault.kind.code != "BAD_LOG":
            raise
        status = fault.kind.exit_status
        return status, f"{'no log':<10} {fault.line}", ReportedFault(fault.kind.code, fault.line, status)
    verdict = judged.verdict
    line = f"{verdict.control:<10} {path}: {verdict.headline.removeprefix(f'{verdict.control}: ')}"
    return verdict.exit_status(strict), line, judged


def _in_words(judged: "Judged", verbose: bool, strict: bool) -> list[str]:
    from cockpit.judge.verdict_words import in_words, shortened, strictly

    verdict = judged.verdict
    known = {line.partition(":")[0].lower().replace("_", "-") for line in (*verdict.faults, *verdict.told)}
    findings = [f"finding  {finding.in_words()}" for finding in judged.findings if finding.kind not in known]
    return [*in_words(verdict, verbose), *shortened(findings, verbose), *strictly(verdict, strict)]
