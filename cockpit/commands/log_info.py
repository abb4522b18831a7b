"""`stickslip log info`: the verdict on the run in a log and the findings of its check; a line a log for several."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import STDOUT, Json, carry_out, tell
from cockpit.commands.options import Strict, Verbose, watched_share

if TYPE_CHECKING:
    from bridge.log.check.log_check import LogCheck
    from cockpit.judge.verdict import RunVerdict

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
            verdict, check = _judged(logs[0], quiet)
            tell(as_json, _as_json(verdict, check), _in_words(verdict, check, verbose, strict))
            return verdict.exit_status(strict)
        rows = [_row(path, quiet, strict) for path in logs]
        tell(as_json, [result for _, _, result in rows], [line for _, line, _ in rows])
        return min((status for status, _, _ in rows), key=_WORST_FIRST.index)

    carry_out(work, as_json)


def _judged(path: Path, quiet: bool) -> "tuple[RunVerdict, LogCheck]":
    from cockpit.judge.judged import judge_log

    with watched_share(f"judging {path.name}", quiet=quiet) as progress:
        verdict, check, _ = judge_log(path, progress)
    return verdict, check


def _row(path: Path, quiet: bool, strict: bool) -> tuple[int, str, dict[str, Any]]:
    """Exit status, line and JSON of one log of several; a file that is no log does not end the others."""
    from cockpit.judge.verdict_words import headline

    try:
        verdict, check = _judged(path, quiet)
    except Fault as fault:
        if fault.kind.code != "BAD_LOG":
            raise
        result = {"fault": fault.kind.code, "line": fault.line, "exit_status": fault.kind.exit_status}
        return fault.kind.exit_status, f"{'no log':<10} {fault.line}", result
    line = f"{verdict.control:<10} {path}: {headline(verdict).removeprefix(f'{verdict.control}: ')}"
    return verdict.exit_status(strict), line, _as_json(verdict, check)


def _as_json(verdict: "RunVerdict", check: "LogCheck") -> dict[str, Any]:
    return verdict.as_dict() | {"findings": check.as_dict()["findings"]}


def _in_words(verdict: "RunVerdict", check: "LogCheck", verbose: bool, strict: bool) -> list[str]:
    from cockpit.judge.verdict_words import in_words, shortened, strictly

    known = {line.partition(":")[0].lower().replace("_", "-") for line in (*verdict.faults, *verdict.told)}
    findings = [f"finding  {finding.in_words()}" for finding in check.findings if finding.kind not in known]
    return [*in_words(verdict, verbose), *shortened(findings, verbose), *strictly(verdict, strict)]
