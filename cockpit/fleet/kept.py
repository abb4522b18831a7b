"""Stored results in the folder of a fleet: one per content of an evidence folder and version of the diagnosis."""

import hashlib
import json
from functools import cache
from pathlib import Path
from typing import Any

from pydantic import ConfigDict, TypeAdapter, ValidationError

from bridge.files import read_json, write_whole
from bridge.provenance import file_sha256
from diagnosis.evidence.manifest import MANIFEST, read_manifest
from diagnosis.result import Diagnosis

FORMAT = "fleet-result/1"
RESULTS = "results"  # name of the folder of stored results, in the folder of a fleet


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
