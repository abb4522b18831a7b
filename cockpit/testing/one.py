"""One test: a scenario is run in simulated time, and its expectations are judged on the log."""

import shlex
import shutil
from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final, Literal, NamedTuple

from bridge.faults import Fault
from bridge.files import shown
from bridge.log.logfile import read_run
from bridge.results import in_json
from bridge.units import counted
from cockpit.expect.judge import FAILED, PASSED, UNTESTED, Expected, judge
from cockpit.expect.record import Record
from cockpit.expect.tables import MutantTable
from cockpit.run.run_tables import RunTables
from cockpit.testing.picture import picture
from cockpit.testing.target import NO_TARGET, Loaded, Target, load

ERROR: Final = "ERROR"
Verdict = Literal["PASSED", "FAILED", "UNTESTED", "ERROR"]


class TestCase(NamedTuple):
    """A test to run: a scenario file, and possibly one of its mutants."""

    __test__ = False  # pytest takes it for a class of tests
    name: str
    file: Path
    settings: list[str]
    target: Target = NO_TARGET
    mutant: MutantTable | None = None  # None: the scenario without a defect


class Tested(NamedTuple):
    """The result of one test."""

    name: str
    file: str
    rig: str = ""
    seed: int = 0
    defect: str = ""  # of a mutant; empty for the scenario itself
    expectations: list[Expected] = []
    error: str = ""  # reason for which nothing could be judged; else empty
    log: str = ""  # kept log; empty for a log that was deleted
    checksum: str = ""  # SHA-256 of the log
    untested: bool = False  # the error is that this rig cannot run it
    picture: str = ""  # SVG of the expectation that decides
    JSON_OPTIONAL = "defect", "error", "log", "checksum", "untested", "picture"

    def judged(self, log: Path, run: RunTables) -> "Tested":
        """The test with the results of its expectations on a log, and their picture. Raises Fault BAD_LOG."""
        record = Record(read_run(log), run.duration_s or None)
        results = judge(record, run.expect)
        drawn = picture(record, run.expect, results)
        return self._replace(expectations=results, checksum=record.run.checksums.sha256, picture=drawn)

    def without_result(self, fault: Fault) -> "Tested":
        """The test that could not be run or judged."""
        return self._replace(error=f"{fault.kind.code}: {fault.line}", untested=fault.kind.code == "NOT_JUDGED")

    @in_json
    def result(self) -> Verdict:
        """ERROR if nothing was judged; FAILED with a failed expectation; PASSED only if all of them passed."""
        if self.error:
            return UNTESTED if self.untested else ERROR
        results = {row.result for row in self.expectations}
        return FAILED if FAILED in results else PASSED if results == {PASSED} else UNTESTED

    @property
    def why(self) -> str:
        """The result in words: the error, or the number of expectations by result."""
        if self.error or not self.expectations:
            return self.error or "no [[expect]] is in the scenario"
        counts = Counter(row.result for row in self.expectations)
        if counts.keys() == {PASSED}:
            return counted(len(self.expectations), "expectation")
        return ", ".join(f"{counts[result]} {result}" for result in (FAILED, UNTESTED, PASSED) if counts[result])

    def in_words(self) -> list[str]:
        """Lines: the result, each expectation that did not pass, the log and the line that replays it."""
        lines = [f"{self.result:<8} {self.name}{f' with {self.defect}' if self.defect else ''}: {self.why}"]
        lines += [f"  {row.in_words()}" for row in self.expectations if row.result != PASSED]
        return [*lines, *([f"  replay   stickslip replay {shlex.quote(self.log)}"] if self.log else [])]


def loaded(case: TestCase) -> Loaded:
    """The test, with its mutant's defect. Raises Fault CONFIG, NOT_JUDGED."""
    defect = case.mutant or MutantTable.model_construct()
    made = load(str(case.file), [*case.settings, *defect.settings], case.target)
    return made._replace(run=made.run.model_copy(update={"fault": [*made.run.fault, *defect.fault]}))


def run_test(case: TestCase, keep: Path | None) -> Tested:
    """Run one test; a log whose test did not pass is moved into the folder `keep`, None: deleted."""
    tested = Tested(case.name, shown(case.file), defect=case.mutant.in_words() if case.mutant else "")
    try:
        test = loaded(case)
        tested = tested._replace(rig=test.run.rig.name, seed=test.run.seed)
        with TemporaryDirectory() as folder:
            log = Path(folder) / f"{case.name}.mcap"
            test.make(str(case.file), log)
            tested = tested.judged(log, test.run)
            if keep is None or tested.result == PASSED:
                return tested
            keep.mkdir(parents=True, exist_ok=True)
            return tested._replace(log=shown(Path(shutil.move(log, keep / log.name))))
    except Fault as fault:
        return tested.without_result(fault)


def judge_old(case: TestCase, log: Path) -> Tested:
    """Judge the expectations of a scenario on a log of any rig."""
    tested = Tested(case.name, shown(case.file))
    try:
        run = loaded(case).run
        return tested._replace(rig=run.rig.name, seed=run.seed, log=shown(log)).judged(log, run)
    except Fault as fault:
        return tested.without_result(fault)
