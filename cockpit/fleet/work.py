"""Work on a fleet: stored results are not repeated, and an interrupted run resumes where it ended."""

import os
import time
from collections.abc import Generator, Iterator
from itertools import count
from pathlib import Path

from bridge.faults import Fault
from bridge.results import write_json
from cockpit.fleet.groups import Diagnosed, Failed, Fleet, fleet_of
from cockpit.fleet.kept import digest_of, evidence_files, keep, kept
from cockpit.fleet.page import write_page
from cockpit.run.writable import written
from diagnosis.diagnose_many import EvidenceFolder, FolderResult
from diagnosis.report.page import write_report
from diagnosis.result import Diagnosis
from diagnosis.version import tool_version

INDEX, INDEX_JSON = "index.html", "index.json"
_LONGEST_NAME_BYTES = 200  # longest name of a report: a number and `.html.part` follow, up to 255 bytes are possible


class FleetFolder:
    """The folder of a fleet: a report and a stored result per rig, and the index, which is complete at any time.

    Faults are not stored: their folders are tried again.

    Args:
        at: the folder; created if missing.
        sources: all folders of the fleet.
        budget_s: time limit per folder; None: no limit.

    """

    def __init__(self, at: Path, sources: list[EvidenceFolder], budget_s: float | None) -> None:
        self._at, self._sources = at, sources
        self._tool, self._budget_s = tool_version(), budget_s
        self._reports = report_names([source.name for source in sources])
        self._digests = {source.name: self._digest(source) for source in sources}
        self._outcomes: dict[str, FolderResult] = {}
        self._written: dict[str, str] = {}  # reports by name of the source
        self.refused: list[Fault] = []  # failed writes

    def kept(self) -> list[FolderResult]:
        """Stored results of earlier runs; their diagnoses have no pictures."""
        for source in self._sources:
            digest = self._digests[source.name]
            stored = kept(self._at, digest) if digest else None
            if stored is not None:
                diagnosis, self._written[source.name] = stored
                self._outcomes[source.name] = FolderResult(source, diagnosis, None)
        self._index()
        return list(self._outcomes.values())

    def add(self, outcome: FolderResult) -> None:
        """Write the report and the result, and update the index."""
        name, diagnosis = outcome.source.name, outcome.diagnosis
        self._outcomes[name] = without_pictures(outcome)
        if diagnosis is not None:
            written(lambda: self._write(outcome.source, diagnosis), self.refused)
        self._index()

    def fleet(self) -> Fleet:
        """The fleet from the results so far."""
        outcomes = [self._outcomes[source.name] for source in self._sources if source.name in self._outcomes]
        done = [
            Diagnosed(outcome.source.name, outcome.diagnosis, self._written.get(outcome.source.name, ""))
            for outcome in outcomes
            if outcome.diagnosis is not None
        ]
        failed = [Failed(outcome.source.name, *outcome.fault) for outcome in outcomes if outcome.fault is not None]
        left = [source.name for source in self._sources if source.name not in self._outcomes]
        return fleet_of(done, failed, left)

    def _write(self, source: EvidenceFolder, diagnosis: Diagnosis) -> None:
        report = self._reports[source.name]
        write_source_report(source, diagnosis, self._at / report)
        self._written[source.name] = report
        digest = self._digests[source.name]
        if digest and digest == self._digest(source):  # its files may have changed during the diagnosis
            keep(self._at, digest, diagnosis, report)

    def _index(self) -> None:
        fleet = self.fleet()
        written(lambda: write_json(self._at / INDEX_JSON, fleet), self.refused)
        written(lambda: write_page(fleet, self._at / INDEX), self.refused)

    def _digest(self, source: EvidenceFolder) -> str:
        """Digest of the source; empty for unreadable evidence, whose diagnosis reports the reason."""
        try:
            return digest_of(source.folder, self._tool, self._budget_s)
        except (Fault, OSError):
            return ""


def write_source_report(source: EvidenceFolder, diagnosis: Diagnosis, path: Path) -> None:
    """Write the report, with the files of the evidence listed at its end. Raises Fault BAD_EVIDENCE, OSError."""
    write_report(diagnosis, source.name, path, evidence_files(source.folder))


def with_estimate(outcomes: Iterator[FolderResult], left: int) -> Generator[tuple[FolderResult, str]]:
    """Each outcome with the estimated time left, in words; empty after the last outcome.

    Args:
        outcomes: outcomes in order of completion.
        left: number of outcomes.

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
    """The outcome without its pictures, the largest part: hundreds of folders must fit into memory."""
    return outcome._replace(diagnosis=outcome.diagnosis and outcome.diagnosis._replace(pictures=()))


def report_names(names: list[str]) -> dict[str, str]:
    """Distinct file names for the reports, different from the index; a name may be a path, to separate folders of equal name."""
    reports: dict[str, str] = {}
    taken = {Path(INDEX).stem}
    for name in names:
        base = name.strip("/").replace("/", "_")
        while len(os.fsencode(base)) > _LONGEST_NAME_BYTES:  # keep the end of a path, its most specific part
            base = base[1:]
        stems = (base if number == 1 else f"{base}-{number}" for number in count(1))
        unique = next(stem for stem in stems if stem.casefold() not in taken)  # some file systems ignore case
        taken.add(unique.casefold())
        reports[name] = f"{unique}.html"
    return reports
