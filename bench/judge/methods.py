"""The methods by name, and their answers, kept by the version of the method and the hash of the evidence."""

import hashlib
import math
import resource
from collections.abc import Callable, Iterator, Sequence
from functools import cache
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

from bench.judge.cases import ANSWERS, Case
from bridge.faults import Fault
from bridge.files import read_json
from bridge.results import write_json
from diagnosis.threads import one_thread
from diagnosis.version import NOT_JUDGED, definitions_digest

Answer = dict[str, float]
NOT_KEPT = "not kept"  # fault of a method that needs kept data which are missing
_ROOT = Path(__file__).parents[2]
_READERS = ("diagnosis/evidence", "diagnosis/features", "diagnosis/gap", "diagnosis/model")


class Method(NamedTuple):
    """A way to name the cause."""

    # from an evidence folder and a time budget [s] (None: no limit); None where it needs kept data that are missing
    answer: Callable[[Path, float | None], Answer | None]
    code: tuple[str, ...]  # files and folders that the answer depends on, relative to the root


class Given(NamedTuple):
    """The answer of a method to one case."""

    method: str
    case: str
    probabilities: Answer  # empty where the method gave none
    cpu_s: float | None  # of the call that made it
    fault: str = ""  # reason of a missing answer


def methods() -> dict[str, Method]:
    """Every method; a new one is a new line."""
    from bench.judge import lines, refits, trees

    return {
        "verdict": Method(refits.verdict, ("diagnosis", "plant", "bench/judge/refits.py")),
        "BIC": Method(refits.bic, ("bench/judge/refits.py", "bench/judge/fits.json.gz")),
        "lines": Method(lines.answer, (*_READERS, "bench/judge/lines.py", "bench/judge/columns.py")),
        "trees": Method(trees.answer, (*_READERS, "plant", "bench/judge/trees.py", "bench/judge/features.py")),
    }


def known(names: Sequence[str]) -> None:
    """Raise Fault CONFIG for the name of a method that does not exist."""
    if unknown := [name for name in names if name not in methods()]:
        raise Fault("CONFIG", f"{unknown[0]}: no such method; there are {', '.join(methods())}")


@cache
def version(method: str) -> str:
    """Hash over the code of a method; kept data count with their bytes."""
    total = hashlib.sha256()
    for place in methods()[method].code:
        path = _ROOT / place
        kept = path.is_file() and path.suffix != ".py"
        total.update(path.read_bytes() if kept else definitions_digest(_ROOT, (place,), NOT_JUDGED).encode())
    return total.hexdigest()[:12]


def ask(
    folder: Path, names: Sequence[str], cases: Sequence[Case], jobs: int, budget_s: float | None
) -> Iterator[Given]:
    """Ask the methods about the cases; answers of the same code to the same evidence are read from `folder`.

    Cases of one campaign go to one process, one after the other, as the trees are trained once for all of them.
    """
    todo: list[tuple[str, list[Case]]] = []
    for name in names:
        missing = [case for case in cases if not _path(folder, name, case).exists()]
        yield from (_read(folder, name, case) for case in cases if case not in missing)
        missing.sort(key=_campaign)
        todo += [(name, list(group)) for _, group in groupby(missing, _campaign)]
    if jobs == 1:
        for name, group in todo:
            for case in group:
                yield _asked(folder, name, case, budget_s)
        return
    tasks = (delayed(_asked_all)(folder, name, group, budget_s) for name, group in todo)
    done: Any = Parallel(n_jobs=jobs, return_as="generator_unordered", batch_size=1)(tasks)  # pyright: ignore[reportArgumentType]
    for group in done:
        yield from group


def _campaign(case: Case) -> bytes:
    return (case.folder / "manifest.toml").read_bytes()


def _asked_all(folder: Path, name: str, cases: list[Case], budget_s: float | None) -> list[Given]:
    return [_asked(folder, name, case, budget_s) for case in cases]


def _asked(folder: Path, name: str, case: Case, budget_s: float | None) -> Given:
    before = _cpu_s()
    try:
        with one_thread():
            answer, fault = methods()[name].answer(case.folder, budget_s), ""
    except Fault as error:
        answer, fault = {}, str(error)
    if answer is None:
        return Given(name, case.name, {}, None, NOT_KEPT)
    probabilities = dict(answer)
    cpu_s = probabilities.pop("cpu_s", _cpu_s() - before)
    if bad := {key: value for key, value in probabilities.items() if not 0.0 <= value <= 1.0 + 1e-9}:
        raise ValueError(f"{name} on {case.name}: {bad}: probabilities must be from 0 to 1")
    given = Given(name, case.name, probabilities, round(cpu_s, 2), fault)
    write_json(_path(folder, name, case), given._asdict())
    return given


def _read(folder: Path, name: str, case: Case) -> Given:
    return Given(**read_json(_path(folder, name, case)))


def _path(folder: Path, name: str, case: Case) -> Path:
    return folder / ANSWERS / f"{name}-{version(name)}" / f"{case.name}-{case.sha256[:12]}.json"


def _cpu_s() -> float:
    """CPU time of this process and of its children that ended."""
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return math.fsum(usage.ru_utime + usage.ru_stime for usage in used)
