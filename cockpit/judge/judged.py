"""Judges a run from its log, or from the arrays of a log in memory."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from bridge.faults import Fault
from bridge.log.check.log_check import LogCheck
from bridge.log.finding import Finding
from bridge.log.log_reader import LogReader
from bridge.log.logfile import RunData, check_log_file, feed
from bridge.results import in_json
from cockpit.judge.phases import Phase
from cockpit.judge.run_judge import RunJudge
from cockpit.judge.setup import is_known
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import in_words
from diagnosis.slips import Cycles

_PIECE_ROWS = 4096  # messages of a log in memory that the judge takes per call


class Judged(NamedTuple):
    """Verdict, findings and judge of a log."""

    verdict: RunVerdict
    check: LogCheck  # the findings of `log check`
    judge: RunJudge
    JSON_MERGED = "verdict"
    JSON_HIDDEN = "check", "judge"

    @in_json
    def findings(self) -> list[Finding]:
        """The findings of `log check`."""
        return self.check.findings


def judge_log(
    path: Path, progress: Callable[[float], None] | None = None, stretch_from_s: float | None = None
) -> Judged:
    """Judge and check a log in one pass, in constant memory. Raises Fault BAD_LOG.

    `progress` is called with the share of the log read so far, 0 to 1; `stretch_from_s` as of `RunJudge`.
    """
    check_log_file(path)
    reader = LogReader(path)
    judge = RunJudge(path, reader.metadata, stretch_from_s=stretch_from_s)
    checksums = feed(reader, judge, progress)
    if not (reader.damage.closed or is_known(reader.metadata)):
        line = f"{path}: is cut after {reader.size_bytes} bytes, before the configuration of the controller: cannot be judged"
        raise Fault("BAD_LOG", f"{line}; `stickslip log check {path}` lists its messages; record the run again")
    verdict = judge.result(reader.damage, checksums, reader.foreign)
    return Judged(verdict, judge.log.result(reader, checksums), judge)


def judge(path: Path) -> RunVerdict:
    """Read a log and judge its run. Raises Fault BAD_LOG."""
    return judge_log(path).verdict


def judge_tables(run: RunData) -> tuple[RunVerdict, Cycles | None]:
    """Judge a log in memory, for figures and pages; returns verdict and slips. Raises Fault BAD_LOG."""
    judge = RunJudge(run.path, run.headers)
    judge.log.events.add(run.events)
    tables = {name: getattr(run, name) for name in ("trace", "applied", "command", "state", "announce", "sensors")}
    pieces = max(map(len, tables.values())) // _PIECE_ROWS + 1
    for piece in range(pieces):  # the pieces of all tables cover the same time, apart from missing messages
        for name, table in tables.items():
            part = table[len(table) * piece // pieces : len(table) * (piece + 1) // pieces]
            judge.add(name, part, part["t_ns"])
    return judge.result(run.damage, run.checksums, run.foreign), judge.cycles


class RunOutcome(NamedTuple):
    """Verdict on a run, name and effects of its rig."""

    verdict: RunVerdict
    rig: str
    effects: list[str]  # effects of the rig
    without: Phase | None  # the stretch `after`, simulated without the controller; None without the option `--without`
    JSON_MERGED = "verdict"
    JSON_OPTIONAL = "effects", "without"

    def in_words(self, verbose: bool) -> list[str]:
        """The verdict in six lines; with `verbose` all figures."""
        lines = in_words(self.verdict, verbose, self.without)
        if verbose:
            lines.append(f"rig      {self.rig}" + (f", with {', '.join(self.effects)}" if self.effects else ""))
        return lines
