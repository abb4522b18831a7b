"""Access to a rig and the rights of each role: real sessions on loopback, with passwords and with TLS."""

import os
import stat
import time
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest
import zenoh

from bridge.faults import FAULTS, Fault
from bridge.wire import loopback_users
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import TOPICS
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from cockpit.run.authority import make_certificates
from tests.system.ports import free_endpoint
from tests.system.rogue import rogue
from tests.system.run_under_way import call

pytestmark = pytest.mark.realtime

CLIENTS = ("controller", "recorder", "operator", "viewer")
SAYS = {
    "controller": {"command", "trace", "state", "snapshot", "event/controller"},
    "recorder": {"event/recorder"},
    "operator": {"operator", "fault"},
    "viewer": set(),
}


@pytest.fixture(scope="module")
def certificates(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("certificates")
    make_certificates(folder, [])
    return folder


@pytest.fixture(params=["password", "certificate"])
def config(request: pytest.FixtureRequest, certificates: Path) -> Iterator[BusConfig]:
    endpoint = free_endpoint()
    if request.param == "password":
        yield BusConfig(endpoint=endpoint)
    else:
        yield BusConfig(endpoint=endpoint.replace("tcp/", "tls/"), certificates=str(certificates))


def test_each_role_may_publish_only_its_topics(config: BusConfig) -> None:
    heard, rig_says = Inbox(1000), Inbox(1000)
    with ExitStack() as sessions:
        plant = sessions.enter_context(Bus(config, "plant", lockstep=False))
        clients = {role: sessions.enter_context(Bus(config, role, lockstep=False)) for role in CLIENTS}
        for topic in TOPICS:
            plant.listen(topic, heard.push)
            if topic.sender == "plant":
                clients["viewer"].listen(topic, rig_says.push)
        for role in ("controller", "recorder", "operator", "viewer"):
            clients[role].announce()
        plant.announce()
        assert not clients["viewer"].wait_for({"plant", "controller", "recorder"}, 10.0)
        for role, bus in clients.items():
            for topic in TOPICS:
                bus.publisher(topic)(role.encode())
        for topic in TOPICS:
            if topic.sender == "plant":
                plant.publisher(topic)(b"rig")
        time.sleep(0.5)
        said: dict[str, set[str]] = {role: set() for role in CLIENTS}
        while (received := heard.get()) is not None:
            if received.payload != b"rig":
                said[received.payload.decode()].add(received.topic.name)
        assert said == SAYS
        passed_on = [received.payload for received in iter(rig_says.get, None)]
        assert passed_on.count(b"rig") == 4
        assert set(passed_on) == {b"rig", b"viewer"}  # its own words come back to it, inside its own session
        assert not plant.wait_for({"controller", "recorder"}, 1.0)


def test_a_viewer_cannot_pass_for_another_role(config: BusConfig) -> None:
    with Bus(config, "plant", lockstep=False) as plant, Bus(config, "viewer", lockstep=False) as viewer:
        session = viewer._session
        tokens = [
            session.liveliness().declare_token(f"rig/{name}")
            for name in ("alive/plant", "alive/controller", "claim/controller/0")
        ]
        answering = session.declare_queryable("rig/header/plant", lambda query: query.drop())
        with Bus(config, "recorder", lockstep=False) as recorder:
            assert recorder.wait_for({"controller"}, 0.5) == {"controller"}
            plant.serve_header(wire.Header(role="plant", schema_version=2))
            began_s = time.monotonic()
            assert [
                reply.ok.payload.to_bytes()[:2] for reply in recorder._session.get("rig/header/*", timeout=2.0)
            ] == [b"\n\x05"]
            assert time.monotonic() - began_s < 1.5  # no silent session was queried
        assert not plant.alive("controller")
        assert tokens
        assert answering


def test_without_the_password_no_client_connects() -> None:
    config = BusConfig(endpoint=free_endpoint())
    with Bus(config, "plant", lockstep=False):
        for wrong in (None, {"user": "controller", "password": "x"}, {"user": "rig", "password": ""}):
            with (
                pytest.raises(zenoh.ZError),
                rogue(config.endpoint, more={"transport/auth/usrpwd": wrong} if wrong else {}),
            ):
                pass
        with rogue(config.endpoint, "controller"):  # as PROTOCOL.md describes for a foreign client
            pass


def test_without_a_certificate_of_the_authority_no_client_connects(certificates: Path, tmp_path: Path) -> None:
    config = BusConfig(endpoint=free_endpoint().replace("tcp/", "tls/"), certificates=str(certificates))
    make_certificates(tmp_path / "other", [])
    known = {"transport/link/tls/root_ca_certificate": str(certificates / "authority.pem")}
    other = {
        **known,
        "transport/link/tls/enable_mtls": True,
        "transport/link/tls/connect_certificate": str(tmp_path / "other" / "controller.pem"),
        "transport/link/tls/connect_private_key": str(tmp_path / "other" / "controller.key"),
    }
    with Bus(config, "plant", lockstep=False):
        for settings in (known, other):
            with pytest.raises(zenoh.ZError), rogue(config.endpoint, more=settings):
                pass
        with pytest.raises(zenoh.ZError), rogue(config.endpoint.replace("tls/", "tcp/")):
            pass


def test_another_role_cannot_pass_for_the_rig(certificates: Path) -> None:
    config = BusConfig(endpoint=free_endpoint().replace("tcp/", "tls/"), certificates=str(certificates))
    listening = {
        "mode": "peer",
        "listen/endpoints": [config.endpoint],
        "connect/endpoints": [],
        "transport/link/tls/root_ca_certificate": str(certificates / "authority.pem"),
        "transport/link/tls/listen_certificate": str(certificates / "viewer.pem"),
        "transport/link/tls/listen_private_key": str(certificates / "viewer.key"),
    }
    with rogue(config.endpoint, more=listening), pytest.raises(Fault, match="check the certificates: both sides"):
        Bus(config, "controller", lockstep=False, patience_s=0.5)


def test_rigs_on_other_ports_have_other_passwords_and_keep_them_over_a_restart() -> None:
    one, other = BusConfig(endpoint=free_endpoint()), BusConfig(endpoint=free_endpoint())
    with Bus(one, "plant", lockstep=False), Bus(other, "plant", lockstep=False):
        words = {loopback_users.password(config.endpoint, role) for config in (one, other) for role in CLIENTS}
    assert len(words) == 8
    with Bus(one, "plant", lockstep=False):
        assert loopback_users.password(one.endpoint, "viewer") in words
    path = loopback_users.make(one.endpoint)
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert path.is_relative_to(os.environ["XDG_RUNTIME_DIR"])


@pytest.mark.parametrize("arguments", [["plant", "--wait-for", ""], ["run"]])
def test_a_rig_that_others_reach_needs_tls(tmp_path: Path, arguments: list[str]) -> None:
    port = free_endpoint().rpartition(":")[2]
    more = ["--log", str(tmp_path / "run.mcap")] if arguments == ["run"] else []
    refused = call(*arguments, "--set", "duration_s=0.1", "--endpoint", f"tcp/0.0.0.0:{port}", *more)
    assert refused.returncode == FAULTS["NOT_SECURE"].exit_status
    assert f"NOT_SECURE: tcp/0.0.0.0:{port}: other computers can reach it" in refused.stderr
    assert "--insecure allows it" in refused.stderr
    assert not list(tmp_path.iterdir())
