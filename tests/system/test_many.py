"""Many evidence folders on several processes and on a Dask cluster: complete when a worker dies, nobody left behind."""

import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from bridge.faults import Fault
from bridge.wire.certificates import CLUSTER, files_of
from cockpit.run.authority import make_certificates
from diagnosis.diagnose_many import EvidenceFolder, FolderResult, diagnose_many, find_sources
from tests import made_up

pytestmark = pytest.mark.slow

NAMES = ["a", "b", "deadly", "refused", "broken"]


def sources(at: Path, names: list[str]) -> list[EvidenceFolder]:
    return find_sources([made_up.evidence_folder(at / name) for name in names])


def by_name(outcomes: Iterator[FolderResult]) -> dict[str, FolderResult]:
    found = list(outcomes)
    result = {outcome.source.name: outcome for outcome in found}
    assert len(found) == len(result)
    return result


def wait_for(condition: Callable[[], bool], seconds: float = 20.0) -> None:
    end_s = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < end_s
        time.sleep(0.05)


def gone(pid: int) -> bool:
    """Whether a process has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


@contextmanager
def cluster(at: Path, workers: int, certs: Path | None = None) -> Iterator[str]:
    """A Dask scheduler with workers, each a process without a nurse that would start it again; its address.

    With TLS where there is a folder of certificates.
    """
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        address = f"{'tls' if certs else 'tcp'}://127.0.0.1:{probe.getsockname()[1]}"
    dask = [sys.executable, "-m", "distributed.cli"]
    quiet = ["--no-dashboard"]
    if certs is not None:
        own = files_of(CLUSTER, certs)
        quiet += ["--tls-ca-file", str(own.authority), "--tls-cert", str(own.certificate), "--tls-key", str(own.key)]
    local = [*quiet, "--no-nanny", "--nthreads", "1", "--host", "127.0.0.1", "--local-directory", str(at)]
    commands = [[f"{dask[2]}.dask_scheduler", "--host", address, *quiet]]
    commands += [[f"{dask[2]}.dask_worker", address, *local]] * workers
    with (at / "cluster.log").open("w") as log:
        processes = [subprocess.Popen([*dask[:2], *one], stdout=log, stderr=log) for one in commands]
        try:
            yield address
        finally:
            for process in processes:
                process.kill()
            for process in processes:
                process.wait()


def test_outcomes_on_two_processes(tmp_path):
    outcomes = by_name(diagnose_many(sources(tmp_path, ["a", "b", "refused", "broken"]), 2, diagnose=made_up.quick))
    assert {name for name, outcome in outcomes.items() if outcome.diagnosis} == {"a", "b"}
    assert outcomes["refused"].fault == ("BAD_EVIDENCE", "run-01.csv: too short")
    assert (outcomes["broken"].fault or ("",))[0] == "DIAGNOSIS_BROKE"
    assert outcomes["a"].diagnosis is not None
    assert outcomes["a"].diagnosis.gap == made_up.diagnosis().gap
    assert outcomes["a"].diagnosis.elapsed_s == 1.0  # the stand-in says the number of jobs here


def test_a_process_that_always_dies_takes_nobody_along(tmp_path):
    outcomes = by_name(diagnose_many(sources(tmp_path, ["a", "killer", "b", "c"]), 2, diagnose=made_up.dies))
    assert {name for name, outcome in outcomes.items() if outcome.diagnosis} == {"a", "b", "c"}
    assert (outcomes["killer"].fault or ("",))[0] == "PEER_DIED"


def test_a_process_that_dies_once_costs_nothing(tmp_path):
    outcomes = by_name(diagnose_many(sources(tmp_path, ["deadly", "a"]), 2, diagnose=made_up.dies))
    assert outcomes.keys() == {"deadly", "a"}
    assert all(outcome.diagnosis for outcome in outcomes.values())


def test_a_killed_dask_worker_costs_nothing(tmp_path):
    (tmp_path / "dask").mkdir()
    with cluster(tmp_path / "dask", workers=2) as address:
        outcomes = by_name(diagnose_many(sources(tmp_path, NAMES), 1, address, made_up.dies))
    killed = int((tmp_path / "deadly" / "killed").read_text())
    assert gone(killed)
    assert {name for name, outcome in outcomes.items() if outcome.diagnosis} == {"a", "b", "deadly"}
    assert outcomes["refused"].fault == ("BAD_EVIDENCE", "run-01.csv: too short")


def test_a_cluster_with_tls(tmp_path):
    (tmp_path / "dask").mkdir()
    make_certificates(tmp_path / "certs", [])
    with cluster(tmp_path / "dask", 1, tmp_path / "certs") as address:
        found = by_name(diagnose_many(sources(tmp_path, ["a"]), 1, address, made_up.quick, str(tmp_path / "certs")))
    assert found["a"].diagnosis is not None


@pytest.mark.parametrize(
    ("address", "rule"),
    [
        ("tcp://192.0.2.1:8786", "must be an address of this computer alone, or tls://"),
        ("tls://127.0.0.1:9", "no such file"),
    ],
)
def test_a_cluster_that_others_reach_needs_certificates(tmp_path, address, rule):
    with pytest.raises(Fault, match=rule) as raised:
        list(diagnose_many(sources(tmp_path, ["a"]), 1, address, made_up.quick, str(tmp_path / "none")))
    assert raised.value.kind.code == "NOT_SECURE"


def test_a_cluster_that_is_not_there(tmp_path):
    started_s = time.monotonic()
    with pytest.raises(Fault, match="no Dask scheduler answers") as raised:
        list(diagnose_many(sources(tmp_path, ["a"]), 1, "tcp://127.0.0.1:9", made_up.quick))
    assert raised.value.kind.code == "NO_PEER"
    assert time.monotonic() - started_s < 15.0


def test_ctrl_c_leaves_no_worker_and_no_file(tmp_path):
    for name in ("a", "b"):
        made_up.evidence_folder(tmp_path / "all" / name)
    # who is started with & by a script ignores Ctrl-C, and so do its children: here it is as a terminal starts a command
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    program += "from diagnosis import diagnose_many as many; from tests import made_up; from cockpit import cli;"
    program += "many.real_diagnose = made_up.endless; cli.main()"
    options = ["diagnose", str(tmp_path / "all"), "--jobs", "2", "--json", str(tmp_path / "out.json")]
    command = subprocess.Popen(
        [sys.executable, "-c", program, *options], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    marks = [tmp_path / "all" / name / "worker" for name in ("a", "b")]
    wait_for(lambda: all(mark.exists() and mark.read_text() for mark in marks))
    workers = [int(mark.read_text()) for mark in marks]
    os.killpg(command.pid, signal.SIGINT)  # as a terminal does: every process of the group
    _, said = command.communicate(timeout=20.0)
    assert command.returncode == 130
    assert said.splitlines()[-1] == "stickslip: INTERRUPTED: stopped by Ctrl-C"
    assert "Traceback" not in said
    wait_for(lambda: all(gone(pid) for pid in workers), 5.0)
    assert not (tmp_path / "out.json").exists()
