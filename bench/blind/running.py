"""Every case of a sealed set diagnosed by the product itself, without the key. A case with a result is not diagnosed again."""

import json
import time
from collections.abc import Generator
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import Any

from bench.blind.sealing import RESULTS, read_set
from bridge.faults import Fault
from bridge.results import strict_json, write_json
from diagnosis import diagnose_many as many
from diagnosis.diagnose_many import EvidenceFolder, FolderResult
from diagnosis.evidence.folder import Evidence
from diagnosis.result import Diagnosis
from diagnosis.version import tool_version

FAULT_FORMAT = "fault/1"


def missing(folder: Path) -> list[str]:
    """Cases of a set without a result. Raises Fault BAD_SET."""
    return [name for name in read_set(folder) if not result_file(folder, name).is_file()]


def result_file(folder: Path, case: str) -> Path:
    """Path of the result of a case."""
    return folder / RESULTS / f"{case}.json"


def run(folder: Path, jobs: int) -> Generator[FolderResult]:
    """Diagnose the cases without a result, one core a case and `jobs` at a time; yield each case when its result is written.

    A case that ends in a fault has this fault as its result. Closing the generator ends the workers; written results stay.
    Raises Fault BAD_SET where the set cannot be read or another version made some of its results, OSError where a result cannot
    be written.
    """
    tool = tool_version()
    for name, result in results(folder, list(read_set(folder))).items():
        if (before := result.get("tool")) != tool:
            line = (
                f"{result_file(folder, name)}: was made by version {before}, this is {tool}: a score is of one version;"
            )
            raise Fault("BAD_SET", f"{line} continue with that version, or delete {folder / RESULTS} and start again")
    sources = [EvidenceFolder(name, folder / name) for name in missing(folder)]
    diagnose = partial(_in_cpu_time, many.real_diagnose)
    with closing(many.diagnose_many(sources, jobs, "", diagnose, shared=False)) as outcomes:
        for outcome in outcomes:
            write_json(result_file(folder, outcome.source.name), _as_json(outcome) | {"tool": tool})
            yield outcome


def _in_cpu_time(diagnose: many.Diagnose, evidence: Evidence, progress: many.Progress, jobs: int) -> Diagnosis:
    before_s = time.process_time()
    diagnosis = diagnose(evidence, progress, jobs)
    return diagnosis._replace(elapsed_s=round(time.process_time() - before_s, 2))


def _as_json(outcome: FolderResult) -> dict[str, Any]:
    if outcome.diagnosis is not None:
        table = strict_json(outcome.diagnosis)
        return table | {"cpu_s": table.pop("elapsed_s")}  # as `_in_cpu_time` measured
    code, line = outcome.fault or ("", "")
    return {"format": FAULT_FORMAT, "fault": code, "line": line}


def results(folder: Path, cases: list[str]) -> dict[str, dict[str, Any]]:
    """The results of those cases that have one, by case. Raises Fault BAD_SET for any other file."""
    paths = {name: result_file(folder, name) for name in cases}
    return {name: _read(path) for name, path in paths.items() if path.is_file()}


def _read(path: Path) -> dict[str, Any]:
    try:
        result = json.loads(path.read_text(encoding="utf-8"))
    except ValueError as error:
        result = str(error)
    if not isinstance(result, dict) or "format" not in result:
        raise Fault(
            "BAD_SET", f"{path}: is not a result of a diagnosis; delete it and run `python -m bench blind run` again"
        )
    return result
