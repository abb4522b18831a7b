"""One test: a scenario is run in simulated time, and its expectations are judged on the log."""

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
from cockpit.run.run import about_run
from cockpit.run.scenario import Scenario, load_scenario
from cockpit.run.simulated.run import simulate

ERROR: Final = "ERROR"
Verdict = Literal["PASSED", "FAILED", "UNTESTED", "ERROR"]


class TestCase(NamedTuple):
    """A test to run: a scenario file, and possibly one of its mutants."""

    __test__ = False  # pytest takes it for a class of tests
    name: str
    file: Path
    settings: list[str]
    mutant: int | None = None  # index in `must_fail`; None: the scenario without a defect


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
    JSON_OPTIONAL = "defect", "error", "log", "checksum"

    def judged(self, log: Path, scenario: Scenario) -> "Tested":
        """The test with the results of its expectations on a log. Raises Fault BAD_LOG."""
        run = read_run(log)
        return self._replace(expectations=judge(Record(run), scenario.expect), checksum=run.checksums.sha256)

    @in_json
    def result(self) -> Verdict:
        """ERROR if nothing was judged; FAILED with a failed expectation; PASSED only if all of them passed."""
        if self.error:
            return ERROR
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
        return [*lines, *([f"  replay   stickslip replay {self.log}"] if self.log else [])]


def loaded(case: TestCase) -> tuple[Scenario, str]:
    """The scenario of a test, with its mutant's defect, and the defect in words. Raises Fault CONFIG."""
    if case.mutant is None:
        return load_scenario(str(case.file), case.settings), ""
    defect = load_scenario(str(case.file), case.settings).must_fail[case.mutant]
    scenario = load_scenario(str(case.file), [*case.settings, *defect.settings])
    about = defect.about or ", ".join([*defect.settings, *(table.in_words() for table in defect.fault)])
    return scenario.model_copy(update={"fault": [*scenario.fault, *defect.fault]}), about


def run_test(case: TestCase, keep: Path | None) -> Tested:
    """Run one test; a log whose test did not pass is moved into the folder `keep`, None: deleted."""
    tested = Tested(case.name, shown(case.file))
    try:
        scenario, defect = loaded(case)
        tested = tested._replace(rig=scenario.rig.name, seed=scenario.seed, defect=defect)
        if scenario.duration_s <= 0.0:
            raise Fault("CONFIG", f"{case.file}: duration_s = 0: a test must have an end; set duration_s")
        with TemporaryDirectory() as folder:
            log = Path(folder) / f"{case.name}.mcap"
            simulate(scenario, log, about_run(scenario, lockstep=True))
            tested = tested.judged(log, scenario)
            if keep is None or tested.result == PASSED:
                return tested
            keep.mkdir(parents=True, exist_ok=True)
            return tested._replace(log=shown(Path(shutil.move(log, keep / log.name))))
    except Fault as fault:
        return tested._replace(error=f"{fault.kind.code}: {fault.line}")


def judge_old(case: TestCase, log: Path) -> Tested:
    """Judge the expectations of a scenario on a log of any rig."""
    tested = Tested(case.name, shown(case.file))
    try:
        scenario, _ = loaded(case)
        tested = tested._replace(rig=scenario.rig.name, seed=scenario.seed, log=shown(log))
        return tested.judged(log, scenario)
    except Fault as fault:
        return tested._replace(error=f"{fault.kind.code}: {fault.line}")
