"""Many tests: the scenarios of files and folders, in processes; the result does not depend on their number."""

import multiprocessing
import os
import re
import signal
import tempfile
import threading
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from difflib import get_close_matches
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

from bridge.config import read_toml
from bridge.faults import FAULTS, Fault
from bridge.kernel_cache import compile_once
from bridge.results import in_json
from bridge.units import counted
from cockpit.expect.judge import FAILED, PASSED, UNTESTED
from cockpit.run.scenario_file import cases_of as sweep_cases
from cockpit.testing.one import ERROR, TestCase, Tested, run_test
from cockpit.testing.target import NO_TARGET, Target, load

_ORDER = (PASSED, FAILED, UNTESTED, ERROR)


class Suite(NamedTuple):
    """Results of many tests, in the order of their files."""

    tests: list[Tested]
    mutants: bool  # each test ran with a defect, under which it has to fail
    without_mutants: list[str]  # names of the tests that have no defect; empty for a run without mutants
    others: int  # .toml files of the folders without [[expect]]

    @in_json
    def counts(self) -> dict[str, int]:
        """Number of tests by result."""
        counts = Counter(test.result for test in self.tests)
        return {result: counts[result] for result in _ORDER}

    @in_json
    def survivors(self) -> list[str]:
        """Defects under which no expectation failed, for a run with mutants."""
        return (
            [f"{test.name} with {test.defect}" for test in self.tests if test.result != FAILED] if self.mutants else []
        )

    @in_json
    def unshown(self) -> list[str]:
        """Expectations that no defect made fail, for a run with mutants: perhaps they cannot."""
        rows = [(test.name, row) for test in self.tests for row in test.expectations] if self.mutants else []
        fails = {(name, row.name) for name, row in rows if row.result == FAILED}
        return [*dict.fromkeys(f"{name}: {row.name}" for name, row in rows if (name, row.name) not in fails)]

    @property
    def exit_status(self) -> int:
        """0: good; 1: a test failed, or a defect went unnoticed; 2: a test could not run; 14: something was not tested."""
        results = {test.result for test in self.tests}
        if self.mutants:
            results = {FAILED if self.survivors else UNTESTED if self.without_mutants else PASSED}
        statuses = {FAILED: 1, ERROR: FAULTS["CONFIG"].exit_status, UNTESTED: FAULTS["NOT_JUDGED"].exit_status}
        return next((status for result, status in statuses.items() if result in results), 0)

    def in_words(self) -> list[str]:
        """Lines for the operator: each test, then the counts."""
        lines: list[str] = []
        alike = Counter(map(_error_of, self.tests))
        for test in self.tests:
            number = alike.pop(_error_of(test), 0)  # an error of all cases of a sweep is reported once
            first, *others = test.in_words()
            also = f" (as in {counted(number - 1, 'other case')})" if test.error and number > 1 else ""
            lines += [f"{first}{also}", *others] if number or not test.error else []
        counts = ", ".join(f"{number} {result}" for result, number in self.counts.items() if number)
        if not self.mutants:
            lines.append(f"tests    {counted(len(self.tests), 'test')}: {counts}")
        else:
            caught = len(self.tests) - len(self.survivors)
            lines.append(f"mutants  {caught} of {counted(len(self.tests), 'defect')} made a test fail")
            lines += [f"MISSED   {line}" for line in self.survivors]
            lines += [f"unshown  {line}: no defect made it fail" for line in self.unshown]
            lines += [f"UNTESTED {name}: no [[must_fail]] is in the scenario" for name in self.without_mutants]
        if self.others:
            lines.append(f"skipped  {counted(self.others, '.toml file')} without [[expect]]")
        return lines


def _error_of(test: Tested) -> tuple[str, str]:
    """The file and the error of a test without the case and its value: `place = value: rule; remedy`."""
    return test.file.partition(":")[0], re.sub(r" = .*?: ", ": ", test.error).replace(test.file, "")


def cases_of(paths: Sequence[Path], settings: list[str], target: Target = NO_TARGET) -> tuple[list[TestCase], int]:
    """The tests of files and folders, and the number of other .toml files in the folders. Raises Fault CONFIG.

    A file in a folder is a test if it holds `[[expect]]`, or a key like it, or cannot be read; a file that is named itself
    is always one. A file with `[[sweep]]` is a test for each of its cases; FILE.toml:CASE names one.
    """
    files: list[Path] = []
    others = 0
    for path in paths:
        if not Path(str(path).partition(":")[0]).exists():
            raise Fault("CONFIG", f"{path}: does not exist: must be a scenario or a folder of them; give another path")
        for file in sorted(path.rglob("*.toml")) if path.is_dir() else [path]:
            if path.is_dir() and not _is_test(file):
                others += 1
            elif file not in files:
                files.append(file)
    if not files:
        raise Fault("CONFIG", f"{', '.join(map(str, paths))}: holds no scenario with [[expect]]; add one to a scenario")
    bare = [Path(str(file).replace(".toml", "")) for file in files]
    stems = Counter(file.name for file in bare)
    names = [file.name if stems[file.name] == 1 else "-".join(file.parts[-2:]) for file in bare]
    cases: list[TestCase] = []
    for name, file in zip(names, files, strict=True):
        parts = _cases(file)
        cases += [TestCase(f"{name}-{part}", Path(f"{file}:{part}"), settings, target) for part in parts]
        cases += [] if parts else [TestCase(name.replace(":", "-"), file, settings, target)]
    return cases, others


def _cases(file: Path) -> list[str]:
    try:
        return [] if ":" in file.name else [*sweep_cases(file, read_toml(file))]
    except Fault:
        return []  # reported as an error of this test


def _is_test(file: Path) -> bool:
    try:
        return bool(get_close_matches("expect", read_toml(file)))
    except Fault:
        return True  # reported as an error of this test


def mutants_of(cases: Sequence[TestCase]) -> tuple[list[TestCase], list[str]]:
    """A test for each defect of the scenarios, and the names of the scenarios without one. Raises Fault CONFIG."""
    mutants: list[TestCase] = []
    without: list[str] = []
    for case in cases:
        defects = load(str(case.file), case.settings, case.target).run.must_fail
        mutants += [case._replace(mutant=defect) for defect in defects]
        without += [] if defects else [case.name]
    return mutants, without


def run_tests(
    cases: Sequence[TestCase], jobs: int, keep: Path | None, progress: Callable[[float], None]
) -> list[Tested]:
    """Run tests in simulated time.

    Args:
        cases: the tests.
        jobs: number of processes.
        keep: folder for the logs of tests that did not pass; None: they are deleted.
        progress: called with the share done.

    """
    if cases and jobs > 1:
        compile_once("the tests", lambda: run_test(cases[0], None))
    done: list[Tested] = []
    for tested in _each(cases, jobs, keep):
        done.append(tested)
        progress(len(done) / len(cases))
    return done


def _each(cases: Sequence[TestCase], jobs: int, keep: Path | None) -> Iterator[Tested]:
    if jobs == 1:
        yield from (run_test(case, keep) for case in cases)
        return
    with TemporaryDirectory(prefix="stickslip-") as folder:
        context = multiprocessing.get_context("spawn")
        pool = ProcessPoolExecutor(jobs, context, _prepare_worker, (folder,))
        try:
            yield from pool.map(partial(run_test, keep=keep), cases)
        except BaseException as error:
            for process in multiprocessing.active_children():  # a test that runs would else continue to its end
                process.terminate()
            if not isinstance(error, BrokenProcessPool):
                raise
            line = "a process of the tests was killed, perhaps as memory ran out"
            raise Fault("PEER_DIED", f"{line}; find its test with --jobs 1") from None
        finally:
            pool.shutdown(cancel_futures=True)


def _prepare_worker(folder: str) -> None:
    """Keep temporary files in a folder of the parent, leave Ctrl-C to the parent, and end after a SIGKILL of the parent."""
    tempfile.tempdir = folder
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = multiprocessing.parent_process()

    def follow() -> None:
        if parent is not None:
            parent.join()
            os._exit(1)

    threading.Thread(target=follow, daemon=True).start()
