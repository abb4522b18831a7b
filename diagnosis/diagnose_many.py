"""Many evidence folders at once: on the cores of this machine, or on a Dask cluster, by the same code.

A worker reads its folder itself, by the absolute path: the workers of a cluster need the same disk and the same version.
"""

import re
import signal
import threading
import traceback
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, cast

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import BrokenProcessPool

from bridge.faults import Fault
from bridge.files import shown
from diagnosis.evidence.folder import Evidence, load_evidence
from diagnosis.evidence.manifest import MANIFEST
from diagnosis.result import Diagnosis

Progress = Callable[[str, float], None]
Diagnose = Callable[[Evidence, Progress, int], Diagnosis]
_CLUSTER_WAIT_S = 5  # for the scheduler to answer, and again for a first worker


class EvidenceFolder(NamedTuple):
    """An evidence folder and the name it goes by in results; no two have the same name."""

    name: str
    folder: Path


class FolderResult(NamedTuple):
    """What became of one folder: a diagnosis, or the code and the line of a fault."""

    source: EvidenceFolder
    diagnosis: Diagnosis | None
    fault: tuple[str, str] | None


def find_sources(folders: list[Path]) -> list[EvidenceFolder]:
    """The evidence folders among `folders` and, where one has no manifest, right below it; each once, in order."""
    found: dict[Path, None] = {}
    for folder in folders:
        try:
            holds = (folder / MANIFEST).is_file()
            inside = sorted(path.parent.resolve() for path in folder.glob(f"*/{MANIFEST}"))
        except OSError:
            holds, inside = False, list[Path]()
        # a folder without any evidence stays: reading it says what is missing
        given = [folder.resolve()] if holds or not inside else inside
        found.update(dict.fromkeys(given))
    names = [folder.name for folder in found]
    unique = [folder if names.count(folder.name) > 1 else Path(folder.name) for folder in found]
    return [EvidenceFolder(shown(name), folder) for name, folder in zip(unique, found, strict=True)]


def real_diagnose(evidence: Evidence, progress: Progress, jobs: int) -> Diagnosis:
    """The real diagnosing function; imported where it works, since it compiles kernels."""
    from diagnosis.diagnose import diagnose  # noqa: PLC0415

    return diagnose(evidence, progress, jobs)


def diagnose_many(
    sources: Iterable[EvidenceFolder], jobs: int, cluster: str = "", diagnose: Diagnose = real_diagnose
) -> Generator[FolderResult]:
    """Yield the outcome of every source, as they come.

    With `cluster`, the address of a Dask scheduler, its workers do it and `jobs` does not matter. `diagnose` must be a
    function of a module, so that it can travel. A folder that cannot be diagnosed, or that kills its worker again and
    again, is an outcome and stops nothing. Raises Fault NO_PEER or CONFIG for the cluster. Closing the generator, or
    Ctrl-C, ends the workers of this machine; a cluster drops what it has not begun.
    """
    waiting = {source.name: source for source in sources}
    with _workers(jobs, cluster) as workers:
        while waiting:
            try:
                for outcome in workers.pool(workers.dispatched)(
                    delayed(_one)(source, diagnose) for source in list(waiting.values())
                ):
                    del waiting[outcome.source.name]
                    yield outcome
            except workers.breakdowns:
                # whose worker died cannot be seen: those that may have been under way are done again, one by one
                for source in list(waiting.values())[: workers.dispatched]:
                    yield _alone(source, diagnose, workers)
                    del waiting[source.name]


def _alone(source: EvidenceFolder, diagnose: Diagnose, workers: "_Workers") -> FolderResult:
    try:
        return next(iter(workers.pool(1)([delayed(_one)(source, diagnose)])))
    except workers.breakdowns as error:
        line = f"{source.folder}: its worker process died ({type(error).__name__}); out of memory? Try fewer or shorter runs"
        return FolderResult(source, None, ("PEER_DIED", line))


def _one(source: EvidenceFolder, diagnose: Diagnose) -> FolderResult:
    try:
        # a worker of the one level is no dispatcher of another: Dask would spread what is inside once more
        with parallel_config("sequential"):
            return FolderResult(source, diagnose(load_evidence(source.folder), lambda _text, _share: None, 1), None)
    except Fault as fault:
        return FolderResult(source, None, (fault.kind.code, fault.line))
    except Exception as error:  # hours of other folders must not end with this one
        at = traceback.extract_tb(error.__traceback__)[-1]
        line = f"{type(error).__name__}: {error} ({Path(at.filename).name}, line {at.lineno})"
        return FolderResult(source, None, ("DIAGNOSIS_BROKE", line))


class _Workers(NamedTuple):
    """Who works."""

    pool: Callable[[int], Any]  # a joblib.Parallel that has so many tasks under way at most
    dispatched: int
    breakdowns: tuple[type[Exception], ...]  # what is raised when a worker died for good


@contextmanager
def _workers(jobs: int, cluster: str) -> Generator[_Workers]:
    if not cluster:
        config = {"backend": "loky", "n_jobs": jobs, "initializer": _leave_interrupt_to_parent}
        yield _Workers(partial(_pool, config), 2 * jobs, (BrokenProcessPool,))
        return
    try:
        from distributed import Client, KilledWorker  # noqa: PLC0415
    except ImportError:
        line = "--cluster: needs the package distributed, which is not installed; pip install 'stickslip[cluster]'"
        raise Fault("CONFIG", line) from None
    if not re.fullmatch(r"(tcp|tls)://.+:\d+", cluster):  # Dask would try for 10 s, and say so with a traceback
        raise Fault("CONFIG", f"--cluster {cluster}: must be tcp://HOST:PORT; write for example tcp://127.0.0.1:8786")
    try:
        client: Any = Client(cluster, timeout=_CLUSTER_WAIT_S, set_as_default=False)
    except (OSError, ValueError) as error:
        line = f"--cluster {cluster}: no Dask scheduler answers ({error}); write for example tcp://127.0.0.1:8786"
        raise Fault("NO_PEER", line) from None
    with client:
        try:
            client.wait_for_workers(1, timeout=_CLUSTER_WAIT_S)
        except TimeoutError:
            raise Fault("NO_PEER", f"--cluster {cluster}: the scheduler has no worker; start some") from None
        from joblib._dask import DaskDistributedBackend  # noqa: PLC0415

        class Cluster(DaskDistributedBackend):
            """Joblib does the work itself where a back-end has one core: the last worker left would stand idle."""

            def effective_n_jobs(self, n_jobs: int) -> int:
                return max(2, super().effective_n_jobs(n_jobs))

        def pool(dispatched: int) -> Any:
            return _pool({"backend": Cluster(client=client, wait_for_workers_timeout=_CLUSTER_WAIT_S)}, dispatched)

        # TimeoutError: not one worker is left
        yield _Workers(pool, 2 * sum(client.ncores().values()), (KilledWorker, TimeoutError))


def _pool(config: dict[str, Any], dispatched: int) -> Any:
    # one task at a time: a task takes seconds, and all that a dead worker had begun is done again
    with parallel_config(**config):
        return Parallel(return_as="generator_unordered", batch_size=cast(Any, 1), pre_dispatch=cast(Any, dispatched))


def _leave_interrupt_to_parent() -> None:
    """Ctrl-C reaches every process of the terminal; the parent ends its workers, which say nothing themselves."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
