"""Work on a fleet: its index page; stored results are not repeated, and an interrupted run resumes where it ended."""

import hashlib
import json
import os
from functools import cache
from itertools import count
from pathlib import Path
from typing import Any
from urllib.parse import quote

from pydantic import ConfigDict, TypeAdapter, ValidationError

from bridge.faults import Fault
from bridge.files import read_json, write_whole
from bridge.pages import filled_page
from bridge.provenance import file_sha256, provenance
from bridge.results import write_json
from bridge.units import counted, interval, percent
from cockpit.fleet.groups import Failed, Fleet, RigGroup, fleet_of
from cockpit.run.writable import written
from diagnosis.diagnose_many import EvidenceFolder, FolderResult
from diagnosis.evidence.manifest import MANIFEST, read_manifest
from diagnosis.report.page import write_report
from diagnosis.result import Diagnosis
from diagnosis.version import tool_version

INDEX, INDEX_JSON = "index.html", "index.json"
_LONGEST_NAME_BYTES = 200  # longest name of a report: a number and `.html.part` follow, up to 255 bytes are possible
FORMAT = "fleet-result/1"
RESULTS = "results"  # name of the folder of stored results, in the folder of a fleet


class FleetFolder:
    """The folder of a fleet: a report and a stored result per rig, and the index, which is complete at any time.

    Faults are not stored: their folders are tried again. `sources` are all folders of the fleet, `budget_s` is the time limit
    per folder, None without a limit.
    """

    def __init__(self, at: Path, sources: list[EvidenceFolder], budget_s: float | None) -> None:
        self._at, self._sources = at, sources
        self._tool, self._budget_s = tool_version(), budget_s
        self._reports = report_names([source.name for source in sources])
        self._digests = {source.name: self._digest(source) for source in sources}
        self._outcomes: dict[str, FolderResult] = {}
        self._written: dict[str, str] = {}  # report file of each source
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
            (outcome.source.name, outcome.diagnosis, self._written.get(outcome.source.name, ""))
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


def write_page(fleet: Fleet, path: Path) -> None:
    """Write the index page of a fleet. Raises Fault LOG_WRITE, OSError."""
    shared = [group for group in fleet.groups if group.kind != "no-gap"]
    text = filled_page(
        Path(__file__).with_name("page.html.j2"),
        f"Fleet of {counted(fleet.folders, 'rig')}",
        provenance().footer(),
        fleet=fleet,
        shared=shared,
        without=[rig for group in fleet.groups if group.kind == "no-gap" for rig in group.rigs],
        rigs=sum(len(group.rigs) for group in shared),
        title=_title,
        percent=percent,
        between=interval,
        counted=counted,
        link=quote,
        most=max((group.helps for group in shared), default=0.0),
    )
    write_whole(path, text)


def _title(group: RigGroup) -> str:
    """Title of a group: the shared cause."""
    if group.kind == "named":
        return group.what
    if group.kind == "not-finished":
        return "not finished: the work ended before any cause was tried"
    return f"unexplained: {group.what}" if group.what else "unexplained, without a known common cause"


def evidence_files(folder: Path) -> list[Path]:
    """The manifest and the distinct files of the runs. Raises Fault BAD_EVIDENCE."""
    runs = dict.fromkeys(run.file for run in read_manifest(folder).run)  # several runs may be parts of a file
    return [folder / MANIFEST, *(folder / file for file in runs)]


def digest_of(folder: Path, tool: str, budget_s: float | None) -> str:
    """SHA-256 over the files of an evidence folder, the version of the diagnosis and its time budget.

    The name of the folder and the times of its files are excluded. Raises Fault BAD_EVIDENCE, OSError.
    """
    # the manifest contains the names of the files
    parts = [tool, str(budget_s), *(file_sha256(path) for path in evidence_files(folder))]
    return hashlib.sha256(json.dumps(parts).encode()).hexdigest()


def keep(fleet: Path, digest: str, diagnosis: Diagnosis, report: str) -> None:
    """Store a result; it is valid only with its report, already written. Raises Fault LOG_WRITE, OSError."""
    table = {
        "format": FORMAT,
        "report": report,
        "report_sha256": file_sha256(fleet / report),
        "diagnosis": _adapter().dump_python(diagnosis._replace(pictures=()), mode="json"),
    }
    write_whole(_place(fleet, digest), json.dumps(table) + "\n")  # keeps NaN and infinity, unlike strict JSON


def kept(fleet: Path, digest: str) -> tuple[Diagnosis, str] | None:
    """A stored result without its pictures, and the file of its report; None without an intact result."""
    try:
        table: dict[str, Any] = read_json(_place(fleet, digest))
        if table["format"] != FORMAT or file_sha256(fleet / table["report"]) != table["report_sha256"]:
            return None
        return _adapter().validate_python(table["diagnosis"]), table["report"]
    except (OSError, ValueError, TypeError, KeyError, ValidationError):
        return None


def _place(fleet: Path, digest: str) -> Path:
    return fleet / RESULTS / f"{digest}.json"


@cache
def _adapter() -> TypeAdapter[Diagnosis]:
    return TypeAdapter(Diagnosis, config=ConfigDict(arbitrary_types_allowed=True, ser_json_inf_nan="constants"))
