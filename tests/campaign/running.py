"""A case from nothing to its result: made, diagnosed, its data removed. A case that has a result is not done again."""

import json
import shutil
import time
import traceback
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import joblib

from diagnosis.diagnose import diagnose as product
from diagnosis.evidence import Evidence, load_evidence
from diagnosis.making import make_evidence
from diagnosis.result import Diagnosis, to_json
from tests.campaign.cases import Planned
from tests.campaign.detectability import of_evidence

Diagnose = Callable[[Evidence], Diagnosis]
EVIDENCE, CASE, RESULT, FAILED = "evidence", "case.json", "result.json", "failed.txt"


def diagnose(evidence: Evidence) -> Diagnosis:
    """The product's own, on one core."""
    return product(evidence, progress=lambda *_: None, jobs=1)


def run(
    folder: Path, planned: list[Planned], jobs: int, diagnose: Diagnose = diagnose
) -> Iterator[tuple[Planned, str]]:
    """Do what has no result yet; what every case ended with, in the order of finishing."""
    missing = [case for case in planned if not (folder / case.folder / RESULT).is_file()]
    tasks = (joblib.delayed(run_one)(folder / case.folder, case, diagnose) for case in missing)
    ended: Any = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")(tasks)
    for index, said in ended:
        yield next(case for case in missing if case.folder == index), said


def run_one(folder: Path, case: Planned, diagnose: Diagnose) -> tuple[str, str]:
    """One case. The name of its folder and one line on how it ended; a fault of the diagnosis is kept with the data."""
    evidence_folder = folder / EVIDENCE
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / CASE).write_text(json.dumps(case.to_json(), indent=1))
    try:
        make_evidence(evidence_folder, case.case(), case.seed)
        begin_s = time.perf_counter()
        evidence = load_evidence(evidence_folder)
        found = diagnose(evidence)
        wall_s = round(time.perf_counter() - begin_s, 2)
        (folder / CASE).write_text(json.dumps(case.to_json() | _detectability(case, evidence), indent=1))
    except Exception:  # one case that fails must not stop a night of others
        (folder / FAILED).write_text(traceback.format_exc())
        return case.folder, f"FAILED, see {folder / FAILED}"
    for path in evidence_folder.glob("*.parquet"):
        path.unlink()
    part = folder / (RESULT + ".part")
    part.write_text(json.dumps(to_json(found) | {"wall_s": wall_s}, indent=1))
    part.replace(folder / RESULT)
    return case.folder, f"{found.verdict} {', '.join(found.effects)} in {wall_s:.1f} s"


def _detectability(case: Planned, evidence: Evidence) -> dict[str, Any]:
    """How far above its detection limit the case is."""
    effects = case.case().effects
    return {"detectability": of_evidence(evidence, effects)} if effects else {}


def read(folder: Path) -> list[dict[str, Any]]:
    """Every case with a result: its description, the result under `result`, its folder."""
    return [
        json.loads((path.parent / CASE).read_text())
        | {"result": json.loads(path.read_text()), "folder": path.parent.name}
        for path in sorted(folder.glob(f"*/{RESULT}"))
    ]
