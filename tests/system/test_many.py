"""Many evidence folders on several processes and on a Dask cluster: complete when a worker dies, no process left."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.wire.certificates import CLUSTER, files_of
from cockpit.run.authority import make_certificates
from diagnosis.diagnose_many import EvidenceFolder, FolderResult, diagnose_many, find_sources
from tests import made_up
from tests.blind.generator import Case, draw_effect, make
from tests.blind.small_set import RUNS
from tests.patience import PATIENCE_S

pytestmark = pytest.mark.slow

NAMES = ["a", "b", "deadly", "refused", "broken"]


def sources(at: Path, names: list[str]) -> list[EvidenceFolder]:
    return find_sources([made_up.evidence_folder(at / name) for name in names])


def by_name(outcomes: Iterator[FolderResult]) -> dict[str, FolderResult]:
    results = list(outcomes)
    result = {outcome.source.name: outcome for outcome in results}
    assert len(results) == len(result)
    return result


def wait_for(condition: Callable[[], bool], seconds: float = PATIENCE_S) -> None:
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
        files = files_of(CLUSTER, certs)
        quiet += [
            "--tls-ca-file",
            str(files.authority),
            "--tls-cert",
            str(files.certificate),
            "--tls-key",
            str(files.key),
        ]
    local = [*quiet, "--no-nanny", "--nthreads", "1", "--host", "127.0.0.1", "--local-directory", str(at)]
    commands = [[f"{dask[2]}.dask_scheduler", "--host", address, *quiet]]
    commands += [[f"{dask[2]}.dask_worker", address, *local]] * workers
    with (at / "cluster.log").open("w") as log:
        processes = [subprocess.Popen([*dask[:2], *command], stdout=log, stderr=log) for command in commands]
        try:
            yield address
        finally:
            for process in processes:
                process.kill()
            for process in processes:
                process.wait()


def test_outcomes_on_two_processes(tmp_path):
    """The last folder has two threads, as the substitute reports."""
    names = ["a", "b", "refused", "broken", "c"]
    outcomes = by_name(diagnose_many(sources(tmp_path, names), 2, diagnose=made_up.quick))
    results = {name: outcome.diagnosis for name, outcome in outcomes.items() if outcome.diagnosis}
    assert {name: one.elapsed_s for name, one in results.items()} == {"a": 1.0, "b": 1.0, "c": 2.0}
    assert outcomes["refused"].fault == ("BAD_EVIDENCE", "run-01.csv: too short")
    assert (outcomes["broken"].fault or ("",))[0] == "DIAGNOSIS_BROKE"
    assert results["a"].gap == made_up.diagnosis().gap


@pytest.mark.nightly  # 18 s of CPU; the next has a process that dies once
def test_a_process_that_always_dies_ends_no_other(tmp_path):
    outcomes = by_name(diagnose_many(sources(tmp_path, ["a", "killer", "b", "c"]), 2, diagnose=made_up.dies))
    assert {name for name, outcome in outcomes.items() if outcome.diagnosis} == {"a", "b", "c"}
    assert (outcomes["killer"].fault or ("",))[0] == "PEER_DIED"


def test_a_process_that_dies_once_costs_nothing(tmp_path):
    outcomes = by_name(diagnose_many(sources(tmp_path, ["deadly", "a"]), 2, diagnose=made_up.dies))
    assert outcomes.keys() == {"deadly", "a"}
    assert all(outcome.diagnosis for outcome in outcomes.values())


@pytest.mark.nightly
def test_a_killed_dask_worker_costs_nothing(tmp_path):
    (tmp_path / "dask").mkdir()
    with cluster(tmp_path / "dask", workers=2) as address:
        outcomes = by_name(diagnose_many(sources(tmp_path, NAMES), 1, address, made_up.dies))
    killed = int((tmp_path / "deadly" / "killed").read_text())
    assert gone(killed)
    assert {name for name, outcome in outcomes.items() if outcome.diagnosis} == {"a", "b", "deadly"}
    assert outcomes["refused"].fault == ("BAD_EVIDENCE", "run-01.csv: too short")


@pytest.mark.nightly
def test_a_cluster_with_tls(tmp_path):
    (tmp_path / "dask").mkdir()
    make_certificates(tmp_path / "certs", [])
    with cluster(tmp_path / "dask", 1, tmp_path / "certs") as address:
        results = by_name(diagnose_many(sources(tmp_path, ["a"]), 1, address, made_up.quick, str(tmp_path / "certs")))
    assert results["a"].diagnosis is not None


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
    with pytest.raises(Fault, match="no Dask scheduler answers") as raised:
        list(diagnose_many(sources(tmp_path, ["a"]), 1, "tcp://127.0.0.1:9", made_up.quick))
    assert raised.value.kind.code == "NO_PEER"


@pytest.mark.nightly
def test_after_sigkill_only_missing_results_are_computed(tmp_path):
    """One folder is done, the other under way when everything is killed; the next time only the other is diagnosed."""
    for name in ("a", "slow"):
        made_up.evidence_folder(tmp_path / "all" / name)
    out = tmp_path / "out"
    program = "from diagnosis import diagnose_many as many; from tests import made_up; from cockpit import entry;"
    program += "many.real_diagnose = made_up.marks; entry.main()"
    options = [
        "diagnose",
        str(tmp_path / "all"),
        "--jobs",
        "2",
        "--report",
        str(out),
        "--json",
        str(tmp_path / "all.json"),
    ]
    command = [sys.executable, "-c", program, *options]
    first = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
    wait_for(lambda: (tmp_path / "all/slow/done").exists() and any((out / "results").glob("*.json")))
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    index = json.loads((out / "index.json").read_text())
    assert (index["left"], len(index["groups"][0]["rigs"])) == (["slow"], 1)
    (tmp_path / "all/slow/fast").touch()
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "1 of 2 reused from " in again.stderr
    assert (tmp_path / "all/a/done").read_text() == "once\n"
    assert (tmp_path / "all/slow/done").read_text() == "once\nonce\n"
    assert [result["evidence"] for result in json.loads((tmp_path / "all.json").read_text())["results"]] == [
        "a",
        "slow",
    ]
    assert json.loads((out / "index.json").read_text())["left"] == []


@pytest.mark.nightly
@pytest.mark.timeout(1800)
def test_a_real_fleet_goes_on_after_sigkill(tmp_path):
    """Three rigs, two of them with the same gap; killed after the first result, and then once more with nothing to do."""
    backlash = (draw_effect(np.random.default_rng(3), "drive-backlash"),)
    for number, effects in enumerate(((), backlash, backlash)):
        make(tmp_path / "all" / f"rig-{number}", Case(effects), 100 + number, RUNS)
    out = tmp_path / "out"
    options = ["diagnose", str(tmp_path / "all"), "--jobs", "2", "--report", str(out), "--budget", "60s"]
    command = [sys.executable, "-m", "cockpit", *options]
    first = subprocess.Popen(command, stderr=subprocess.DEVNULL, start_new_session=True)
    wait_for(lambda: any((out / "results").glob("*.json")), 600.0)
    os.killpg(first.pid, signal.SIGKILL)
    first.wait()
    kept = {path: path.stat().st_mtime_ns for path in (out / "results").glob("*.json")}
    again = subprocess.run(command, capture_output=True, text=True, check=True)
    assert f"{len(kept)} of 3 reused from " in again.stderr
    assert all(path.stat().st_mtime_ns == written for path, written in kept.items())
    index = json.loads((out / "index.json").read_text())
    assert (index["folders"], index["failed"], index["left"]) == (3, [], [])
    group = next(group for group in index["groups"] if group["what"] == "drive-backlash")
    assert {rig["evidence"] for rig in group["rigs"]} >= {"rig-1", "rig-2"}
    assert all((out / rig["report"]).is_file() for group in index["groups"] for rig in group["rigs"])
    third = subprocess.run(command, capture_output=True, text=True, check=True)
    assert "3 of 3 reused from " in third.stderr
    assert third.stdout == again.stdout


def test_ctrl_c_leaves_no_worker_and_no_file(tmp_path):
    for name in ("a", "b"):
        made_up.evidence_folder(tmp_path / "all" / name)
    # who is started with & by a script ignores Ctrl-C, and so do its children: here it is as a terminal starts a command
    program = "import signal; signal.signal(signal.SIGINT, signal.default_int_handler);"
    program += "from diagnosis import diagnose_many as many; from tests import made_up; from cockpit import entry;"
    program += "many.real_diagnose = made_up.endless; entry.main()"
    options = ["diagnose", str(tmp_path / "all"), "--jobs", "2", "--json", str(tmp_path / "out.json")]
    command = subprocess.Popen(
        [sys.executable, "-c", program, *options], stderr=subprocess.PIPE, text=True, start_new_session=True
    )
    marks = [tmp_path / "all" / name / "worker" for name in ("a", "b")]
    try:
        wait_for(lambda: all(mark.exists() and mark.read_text() for mark in marks))
        os.killpg(command.pid, signal.SIGINT)  # as a terminal does: every process of the group
        _, errors = command.communicate(timeout=PATIENCE_S)
    except BaseException:
        os.killpg(command.pid, signal.SIGKILL)
        command.communicate()
        raise
    workers = [int(mark.read_text()) for mark in marks]
    assert command.returncode == 130
    assert errors.splitlines()[-1] == "stickslip: INTERRUPTED: stopped by Ctrl-C"
    assert "Traceback" not in errors
    wait_for(lambda: all(gone(pid) for pid in workers))
    assert not (tmp_path / "out.json").exists()
