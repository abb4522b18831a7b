"""The work on a fleet: what is kept is not done again, and whatever ends the work, the next one goes on where it ended."""

import os
import time
from collections.abc import Callable, Generator, Iterator
from itertools import count
from pathlib import Path

from bridge.faults import Fault
from bridge.files import write_json
from cockpit.fleet.groups import Diagnosed, Failed, Fleet, fleet_of
from cockpit.fleet.kept import digest_of, evidence_files, keep, kept
from cockpit.fleet.page import write_page
from cockpit.run.writable import writing
from diagnosis.blind.version import tool_version
from diagnosis.diagnose_many import EvidenceFolder, FolderResult
from diagnosis.report.page import write_report
from diagnosis.result import Diagnosis

INDEX, INDEX_JSON = "index.html", "index.json"
_LONGEST_NAME_BYTES = 200  # of 255 that a disk takes; a number and `.html.part` follow


class FleetFolder:
    """The folder of a fleet: a report and a kept result for each rig, and the index, which is whole at any time.

    A fault is no result: its folder is tried again.

    Args:
        at: the folder; made where it is not there.
        sources: all folders of the fleet.
        budget_s: time that a folder may take; None: all that it takes.

    """

    def __init__(self, at: Path, sources: list[EvidenceFolder], budget_s: float | None) -> None:
        self._at, self._sources = at, sources
        self._tool, self._budget_s = tool_version(), budget_s
        self._reports = report_names([source.name for source in sources])
        self._digests = {source.name: self._digest(source) for source in sources}
        self._outcomes: dict[str, FolderResult] = {}
        self._written: dict[str, str] = {}  # reports, by the name of the source
        self.refused: list[Fault] = []  # what could not be written

    def kept(self) -> list[FolderResult]:
        """The results that are there from before; their diagnoses are without pictures."""
        for source in self._sources:
            digest = self._digests[source.name]
            found = kept(self._at, digest) if digest else None
            if found is not None:
                diagnosis, self._written[source.name] = found
                self._outcomes[source.name] = FolderResult(source, diagnosis, None)
        self._index()
        return list(self._outcomes.values())

    def add(self, outcome: FolderResult) -> None:
        """Write the report, the result and the index anew."""
        name, diagnosis = outcome.source.name, outcome.diagnosis
        self._outcomes[name] = without_pictures(outcome)
        if diagnosis is not None:
            self._refusable(lambda: self._write(outcome.source, diagnosis))
        self._index()

    def fleet(self) -> Fleet:
        """What is known so far."""
        found = [self._outcomes[source.name] for source in self._sources if source.name in self._outcomes]
        done = [
            Diagnosed(one.source.name, one.diagnosis, self._written.get(one.source.name, ""))
            for one in found
            if one.diagnosis is not None
        ]
        failed = [Failed(one.source.name, *one.fault) for one in found if one.fault is not None]
        left = [source.name for source in self._sources if source.name not in self._outcomes]
        return fleet_of(done, failed, left)

    def _write(self, source: EvidenceFolder, diagnosis: Diagnosis) -> None:
        report = self._reports[source.name]
        write_report(diagnosis, source.name, self._at / report, evidence_files(source.folder))
        self._written[source.name] = report
        digest = self._digests[source.name]
        if digest and digest == self._digest(source):  # its files may have changed while it was diagnosed
            keep(self._at, digest, diagnosis, report)

    def _index(self) -> None:
        fleet = self.fleet()
        self._refusable(lambda: write_json(self._at / INDEX_JSON, fleet))
        self._refusable(lambda: write_page(fleet, self._at / INDEX))

    def _refusable(self, write: Callable[[], None]) -> None:
        try:
            with writing():
                write()
        except Fault as fault:
            if fault.line not in {one.line for one in self.refused}:  # the index is written many times
                self.refused.append(fault)

    def _digest(self, source: EvidenceFolder) -> str:
        """Empty where the evidence cannot be read: then the diagnosis says why."""
        try:
            return digest_of(source.folder, self._tool, self._budget_s)
        except (Fault, OSError):
            return ""


def with_estimate(outcomes: Iterator[FolderResult], left: int) -> Generator[tuple[FolderResult, str]]:
    """Each outcome with the time that the other folders may still take, in words; empty after the last one.

    Args:
        outcomes: in the order in which they finish.
        left: their number.

    """
    began_s = time.monotonic()
    for done, outcome in enumerate(outcomes, 1):
        each_s = (time.monotonic() - began_s) / done
        yield outcome, f"about {_in_words(each_s * (left - done))} left" if done < left else ""


def _in_words(duration_s: float) -> str:
    if duration_s < 90.0:
        return f"{max(duration_s, 1.0):.0f} s"
    return f"{duration_s / 60.0:.0f} min" if duration_s < 5400.0 else f"{duration_s / 3600.0:.1f} h"


def without_pictures(outcome: FolderResult) -> FolderResult:
    """Pictures are by far the largest part, and hundreds of folders are meant to fit into memory."""
    return outcome._replace(diagnosis=outcome.diagnosis and outcome.diagnosis._replace(pictures=()))


def report_names(names: list[str]) -> dict[str, str]:
    """A file name for the report of each, none that of the index; a name may be a path, because several folders have the same."""
    found: dict[str, str] = {}
    taken = {Path(INDEX).stem}
    for name in names:
        whole = name.strip("/").replace("/", "_")
        while len(os.fsencode(whole)) > _LONGEST_NAME_BYTES:  # of a path the end tells most
            whole = whole[1:]
        tries = (whole if number == 1 else f"{whole}-{number}" for number in count(1))
        one = next(one for one in tries if one.casefold() not in taken)  # some disks take a and A for the same
        taken.add(one.casefold())
        found[name] = f"{one}.html"
    return found
