"""Diagnosis of many evidence folders: on the cores of one computer, or on a Dask cluster, with the same code.

A worker reads its folder by the absolute path, so the workers of a cluster need the same disk and the same version.
"""

import re
import signal
import sys
import threading
import traceback
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple, cast

from joblib import Parallel, delayed, parallel_config
from joblib.externals.loky import BrokenProcessPool

from bridge.faults import Fault, install
from bridge.files import shown
from bridge.results import in_json
from bridge.wire import certificates
from bridge.wire.bus_config import is_loopback
from diagnosis.evidence.folder import Evidence, load_evidence
from diagnosis.evidence.manifest import MANIFEST
from diagnosis.result import Diagnosis

Progress = Callable[[str, float], None]
Diagnose = Callable[[Evidence, Progress, int], Diagnosis]
# Silences joblib's tracker process, which removes the folders of each killed worker and warns of each.
_NO_WARNING = "ignore:resource_tracker:UserWarning"
_CLUSTER_WAIT_S = 5  # timeout for the scheduler, and again for its first worker; too short fails on a busy network


class EvidenceFolder(NamedTuple):
    """An evidence folder, and its name in the results; no two folders have the same name."""

    name: str
    folder: Path


class FolderFault(NamedTuple):
    """Why a folder has no diagnosis."""

    fault: str  # code of the fault
    line: str


class FolderResult(NamedTuple):
    """The result of one folder: a diagnosis, or the code and the line of a fault."""

    source: EvidenceFolder
    diagnosis: Diagnosis | None
    fault: FolderFault | None
    JSON_HIDDEN = ("source",)
    JSON_OPTIONAL = "diagnosis", "fault"

    @in_json
    def evidence(self) -> str:
        """Name of the folder."""
        return self.source.name


def find_sources(folders: list[Path]) -> list[EvidenceFolder]:
    """The evidence folders among `folders`, each once, in order. A folder without a manifest is searched for evidence folders."""
    sources: dict[Path, None] = {}
    for folder in folders:
        try:
            holds = (folder / MANIFEST).is_file()
            inside = sorted(path.parent.resolve() for path in folder.glob(f"*/{MANIFEST}"))
        except OSError:
            holds, inside = False, list[Path]()
        # a folder without any evidence stays in the list: reading it raises a fault that names the missing manifest
        given = [folder.resolve()] if holds or not inside else inside
        sources.update(dict.fromkeys(given))
    names = [folder.name for folder in sources]
    unique = [folder if names.count(folder.name) > 1 else Path(folder.name) for folder in sources]
    return [EvidenceFolder(shown(name), folder) for name, folder in zip(unique, sources, strict=True)]


def real_diagnose(evidence: Evidence, progress: Progress, jobs: int, budget_s: float | None = None) -> Diagnosis:
    """`diagnosis.diagnose.diagnose`; imported in the worker, as the import compiles kernels."""
    from diagnosis.diagnose import diagnose  # noqa: PLC0415

    return diagnose(evidence, progress, jobs, budget_s)


def diagnose_many(
    sources: Iterable[EvidenceFolder],
    jobs: int,
    cluster: str = "",
    diagnose: Diagnose = real_diagnose,
    certs: str = "",
    shared: bool = True,
) -> Generator[FolderResult]:
    """Yield the result of every source, in the order in which they finish.

    Each folder has one process. If the last folders are at most half as many as the processes of this computer, they start when
    all others are done and have several threads each: two folders on eight cores have four each.

    A folder that cannot be diagnosed, or that kills its worker again and again, yields a fault and stops no other folder. Closing
    the generator, or Ctrl-C, ends the local workers; a cluster drops the folders that it has not begun.

    Raises Fault NO_PEER, CONFIG or NOT_SECURE for the cluster.

    Args:
        sources: from `find_sources`.
        jobs: processes on this computer; without effect with `cluster`.
        cluster: address of a Dask scheduler; empty: none.
        diagnose: a function at the top level of a module, so that it can be sent to a worker.
        certs: folder of the certificates for a cluster at tls://; empty: the user's default folder.
        shared: whether the last folders have several threads; False: one each, so that times are comparable.

    """
    waiting = list(sources)
    with _workers(jobs, cluster, certs) as workers:
        last = len(waiting) % workers.cores
        if cluster or not shared or 2 * last > workers.cores:  # there are not two cores for each
            last = 0
        first = len(waiting) - last
        yield from _several(waiting[:first], _Task(diagnose, 1), workers)
        if last:
            yield from _several(waiting[first:], _Task(diagnose, workers.cores // last), workers)


class _Task(NamedTuple):
    """How a worker diagnoses a folder."""

    diagnose: Diagnose
    jobs: int  # threads for each folder


def _several(sources: list[EvidenceFolder], task: _Task, workers: "_Workers") -> Generator[FolderResult]:
    waiting = {source.name: source for source in sources}
    while waiting:
        try:
            for outcome in workers.pool(workers.dispatched)(
                delayed(_one)(source, task) for source in list(waiting.values())
            ):
                del waiting[outcome.source.name]
                yield outcome
        except workers.breakdowns:
            # It is not known which folder killed its worker: all folders that may have been running are repeated, one by one.
            for source in list(waiting.values())[: workers.dispatched]:
                yield _alone(source, task, workers)
                del waiting[source.name]


def _alone(source: EvidenceFolder, task: _Task, workers: "_Workers") -> FolderResult:
    try:
        return next(iter(workers.pool(1)([delayed(_one)(source, task)])))
    except workers.breakdowns as error:
        return _died(source, error)


def _one(source: EvidenceFolder, task: _Task) -> FolderResult:
    try:
        diagnosis = task.diagnose(load_evidence(source.folder), lambda _text, _share: None, task.jobs)
        return FolderResult(source, diagnosis, None)
    except Fault as fault:
        return FolderResult(source, None, FolderFault(fault.kind.code, fault.line))
    except Exception as error:  # an error in one folder must not end the work on the others
        at = traceback.extract_tb(error.__traceback__)[-1]
        line = f"{type(error).__name__}: {error} ({Path(at.filename).name}, line {at.lineno})"
        return FolderResult(source, None, FolderFault("DIAGNOSIS_BROKE", line))


def _died(source: EvidenceFolder, error: Exception) -> FolderResult:
    line = (
        f"{source.folder}: its worker process died ({type(error).__name__}); out of memory? Try fewer or shorter runs"
    )
    return FolderResult(source, None, FolderFault("PEER_DIED", line))


class _Workers(NamedTuple):
    """A pool of workers, local or on a cluster."""

    pool: Callable[[int], Any]  # makes a joblib.Parallel; argument: largest number of dispatched tasks
    cores: int
    dispatched: int  # largest useful number of dispatched tasks
    breakdowns: tuple[type[Exception], ...]  # exceptions that report a dead worker


def _cluster_security(cluster: str, certs: str) -> Any:
    """Dask's `Security` for a scheduler at tls://; None for a scheduler that only this computer can reach.

    A scheduler, or an attacker on the network between it and this computer, can run code on both. Raises Fault NOT_SECURE for
    any other address.
    """
    scheme, _, place = cluster.partition("://")
    if scheme == "tcp":
        if is_loopback(f"tcp/{place}"):
            return None
        line = f"--cluster {cluster}: others can reach it: must be an address of this computer alone, or tls://"
        remedy = "make certificates with `stickslip certs FOLDER`, start scheduler and workers with cluster.pem and cluster.key"
        raise Fault("NOT_SECURE", f"{line}; {remedy}, and use --cluster tls://{place} --certs FOLDER")
    from distributed.security import Security  # noqa: PLC0415

    files = certificates.checked(certificates.CLUSTER, certificates.folder(certs))
    return Security(
        tls_ca_file=str(files.authority),
        tls_client_cert=str(files.certificate),
        tls_client_key=str(files.key),
        require_encryption=True,
    )


@contextmanager
def _workers(jobs: int, cluster: str, certs: str) -> Generator[_Workers]:
    if not cluster:
        if _NO_WARNING not in sys.warnoptions:
            sys.warnoptions.append(_NO_WARNING)
        config = {"backend": "loky", "n_jobs": jobs, "initializer": leave_interrupt_to_parent}
        yield _Workers(partial(_pool, config), jobs, 2 * jobs, (BrokenProcessPool,))
        return
    try:
        from distributed import Client, KilledWorker  # noqa: PLC0415
    except ImportError:
        line = f"--cluster: needs the package distributed, which is not installed; {install('cluster')}"
        raise Fault("CONFIG", line) from None
    if not re.fullmatch(r"(tcp|tls)://.+:\d+", cluster):  # Dask would try for 10 s and print a traceback
        raise Fault("CONFIG", f"--cluster {cluster}: must be tcp://HOST:PORT; write for example tcp://127.0.0.1:8786")
    security = _cluster_security(cluster, certs)
    try:
        client: Any = Client(cluster, timeout=_CLUSTER_WAIT_S, set_as_default=False, security=security)
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
            """A back-end that never reports one core: joblib would then do the work itself and leave the last worker idle."""

            def effective_n_jobs(self, n_jobs: int) -> int:
                return max(2, super().effective_n_jobs(n_jobs))

        def pool(dispatched: int) -> Any:
            return _pool({"backend": Cluster(client=client, wait_for_workers_timeout=_CLUSTER_WAIT_S)}, dispatched)

        cores = sum(client.ncores().values())
        # TimeoutError: all workers are lost
        yield _Workers(pool, cores, 2 * cores, (KilledWorker, TimeoutError))


def _pool(config: dict[str, Any], dispatched: int) -> Any:
    # one task in a batch: a task takes seconds, and all tasks in the batch of a dead worker are repeated
    with parallel_config(**config):
        return Parallel(return_as="generator_unordered", batch_size=cast(Any, 1), pre_dispatch=cast(Any, dispatched))


def leave_interrupt_to_parent() -> None:
    """Make a worker ignore Ctrl-C, which reaches every process of the terminal; the parent ends its workers."""
    if threading.current_thread() is threading.main_thread():
        signal.signal(signal.SIGINT, signal.SIG_IGN)
