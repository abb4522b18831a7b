"""A stop where bus or disk fail, also after a restart of the rig: a port jammed by random bytes or by idle connections, no
runtime folder, an expired certificate, a full disk. And idle connections while the rig vibrates."""

import contextlib
import json
import os
import resource
import shutil
import socket
import subprocess
import time
from collections.abc import Sequence
from pathlib import Path

import pytest

from bridge.guard.kept import StopLatch
from bridge.wire import certificates
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import APPLIED
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from cockpit.run import authority
from cockpit.run.scenario import load_scenario
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint
from tests.system.run_under_way import COMMAND
from tests.system.test_guard import rig, say

pytestmark = [pytest.mark.realtime, pytest.mark.slow]
# a process that may make and remove files and write no byte to them, as on most full disks
FULL_DISK = ("sh", "-c", 'ulimit -f 0; exec "$@"', "sh")
RIG = load_scenario("from-the-start", []).rig.name


def stop(
    endpoint: str, environment: dict[str, str], *more: str, before: Sequence[str] = ()
) -> tuple[int, dict[str, str]]:
    command = [*before, *COMMAND, "stop", "--json", "--endpoint", endpoint, *more]
    done = subprocess.run(command, env=environment, timeout=60, check=False, capture_output=True, text=True)
    return done.returncode, json.loads(done.stdout)


def await_rig(folder: Path) -> None:
    until_s = time.monotonic() + PATIENCE_S
    while not list(folder.glob("stickslip/rig-*.json")):
        assert time.monotonic() < until_s
        time.sleep(0.1)


def expire(folder: Path, role: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Replace the certificate of a role by one of the same authority that has expired."""
    other = folder / "expired"
    other.mkdir(mode=0o700)
    for name in ("authority.pem", "authority.key"):
        shutil.copy(folder / name, other / name)
    monkeypatch.setattr(authority, "_ROLE_DAYS", -0.001)
    authority.make_certificates(other, [])
    for path in certificates.files_of(role, other)[1:]:
        shutil.copy(path, folder / path.name)


@pytest.mark.parametrize(
    "trouble", ["random bytes", "idle connections", "no runtime folder", "expired certificate", "full disk"]
)
def test_a_stop_needs_no_bus(trouble: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    endpoint, more = free_endpoint(), []
    runtime = tmp_path / "runtime"
    runtime.mkdir(mode=0o700)
    before = FULL_DISK if trouble == "full disk" else ()
    if trouble in {"random bytes", "expired certificate"}:
        folder = tmp_path / "certificates"
        folder.mkdir()
        authority.make_certificates(folder, [])
        endpoint, more = endpoint.replace("tcp/", "tls/"), ["--certs", str(folder)]
        if trouble == "expired certificate":
            expire(folder, "operator", monkeypatch)
    for name, value in (("XDG_STATE_HOME", tmp_path), ("XDG_RUNTIME_DIR", runtime), ("XDG_CACHE_HOME", runtime)):
        monkeypatch.setenv(name, str(value))
    environment = dict(os.environ)
    with rig(endpoint, environment, "--set", "arm=true", *more) as process, contextlib.ExitStack() as links:
        await_rig(tmp_path)
        if trouble in {"random bytes", "idle connections"}:
            for _ in range(500):
                link = links.enter_context(socket.create_connection(("127.0.0.1", BusConfig(endpoint=endpoint).port)))
                with contextlib.suppress(OSError):
                    link.sendall(os.urandom(2000) if trouble == "random bytes" else b"")
        elif trouble == "full disk":
            resource.prlimit(process.pid, resource.RLIMIT_FSIZE, (0, 0))
        elif trouble == "no runtime folder":
            shutil.rmtree(runtime)
        status, stopped = stop(endpoint, environment, *more, before=before)
        assert (status, stopped["state"], stopped["amplitude_m"]) == (0, "FAULT", 0.0)
        if trouble in {"random bytes", "expired certificate"}:
            assert ("expired" if trouble == "expired certificate" else "STOP NOT DELIVERED") in stopped["bus_problem"]
        assert process.poll() is None
    assert StopLatch(RIG).is_set
    if trouble != "full disk":  # it leaves no room for the passwords of another endpoint
        endpoint = free_endpoint()
    with rig(endpoint, environment, "--set", "arm=true", before=before):
        assert say("status", endpoint)[1]["cause"] == "STOP_KEPT"
        assert say("reset", endpoint)[1]["state"] == "DISARMED"
        assert say("stop", endpoint)[1]["state"] == "FAULT"
    assert StopLatch(RIG).is_set


def test_idle_connections_do_not_end_the_vibration(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    config, inbox = BusConfig(endpoint=free_endpoint()), Inbox(20_000)
    control = [*COMMAND, "controller", "--scenario", "from-the-start", "--endpoint", config.endpoint, "--wait", "600"]
    with (
        rig(config.endpoint, dict(os.environ), "--set", "arm=true"),
        subprocess.Popen(control, stderr=subprocess.DEVNULL) as controller,
        contextlib.ExitStack() as links,
    ):
        try:
            viewer = links.enter_context(Bus(config, "viewer", lockstep=False, patience_s=PATIENCE_S))
            viewer.listen(APPLIED, inbox.push)
            while (received := inbox.get(10.0)) and wire.Applied.FromString(
                received.payload
            ).guard_state != wire.ACTIVE:
                pass
            for _ in range(300):
                links.enter_context(socket.create_connection(("127.0.0.1", config.port)))
            time.sleep(4.0)
            applied = [wire.Applied.FromString(message.payload) for message in iter(inbox.get, None)]
        finally:
            controller.kill()
    assert len(applied) > 3000
    assert {row.guard_state for row in applied} <= {wire.ACTIVE, wire.ARMED}
    assert sum(row.amplitude_m > 0.0 for row in applied) > 0.9 * len(applied)
