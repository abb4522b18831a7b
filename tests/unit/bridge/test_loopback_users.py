"""The passwords of a rig on loopback: private, kept between runs, and never read from a file of another user."""

import os
import shutil
import socket
from pathlib import Path

import pytest

from bridge.faults import Fault
from bridge.wire import loopback_users, zenoh_link
from bridge.wire.bus_config import BusConfig, address, is_free, is_loopback
from bridge.wire.session import rig_security, role_security
from tests.system.ports import free_endpoint

ENDPOINT = "tcp/127.0.0.1:7447"


@pytest.fixture
def place(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_RUNTIME_DIR", str(tmp_path / "runtime"))
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    monkeypatch.setenv("TMPDIR", str(tmp_path / "tmp"))
    return tmp_path / "runtime" / "stickslip" / "127.0.0.1-7447.users"


def mode(path: Path) -> int:
    return path.stat().st_mode & 0o777


def test_the_file_is_private_and_stays(place: Path) -> None:
    assert loopback_users.password(ENDPOINT, "viewer") is None
    assert loopback_users.make(ENDPOINT) == place
    assert (mode(place), mode(place.parent)) == (0o600, 0o700)
    before = place.read_text()
    assert [line.partition(":")[0] for line in before.splitlines()] == ["controller", "recorder", "operator", "viewer"]
    assert len({line.partition(":")[2] for line in before.splitlines()}) == 4
    assert loopback_users.make(ENDPOINT).read_text() == before
    assert f"viewer:{loopback_users.password(ENDPOINT, 'viewer')}" in before
    assert loopback_users.password("tcp/127.0.0.1:7448", "viewer") is None


@pytest.mark.parametrize("harm", ["readable", "cut", "link"])
def test_an_untrusted_file_is_replaced(place: Path, harm: str) -> None:
    before = loopback_users.make(ENDPOINT).read_text()
    if harm == "readable":
        place.chmod(0o644)
    elif harm == "cut":
        place.write_text("viewer:")
    else:
        theirs = place.with_name("theirs")
        place.rename(theirs)
        place.symlink_to(theirs)
    assert loopback_users.password(ENDPOINT, "viewer") is None
    assert loopback_users.make(ENDPOINT).read_text() != before
    assert not place.is_symlink()
    assert mode(place) == 0o600


def test_a_folder_that_others_enter_is_passed_over(place: Path, tmp_path: Path) -> None:
    place.parent.mkdir(parents=True)
    place.parent.chmod(0o755)
    assert loopback_users.make(ENDPOINT) == tmp_path / "cache" / "stickslip" / "run" / place.name
    assert loopback_users.password(ENDPOINT, "viewer") is not None


def test_nowhere_to_keep_it_is_a_fault(place: Path, tmp_path: Path) -> None:
    for name in ("runtime", "cache", "tmp"):
        (tmp_path / name).write_text("a file where a folder should be")
    with pytest.raises(Fault, match=r"NOT_SECURE: .*\(Not a directory\).*set XDG_RUNTIME_DIR"):
        loopback_users.make(ENDPOINT)


def test_a_full_disk_keeps_the_passwords_that_exist_and_is_named(place: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_args: object, **_options: object) -> None:
        raise OSError(28, "No space left on device")

    for name in ("mkstemp", "gettempdir"):  # the second writes a file, to choose a folder
        monkeypatch.setattr(f"tempfile.{name}", full)
    assert loopback_users.password(ENDPOINT, "operator") is None
    with pytest.raises(Fault, match="No space left on device"):
        loopback_users.make(ENDPOINT)
    monkeypatch.undo()
    with monkeypatch.context() as patch:
        patch.setenv("XDG_RUNTIME_DIR", str(place.parents[1]))
        assert loopback_users.make(ENDPOINT) == place
        word = loopback_users.password(ENDPOINT, "operator")
        patch.setattr("tempfile.mkstemp", full)
        assert (loopback_users.make(ENDPOINT), loopback_users.password(ENDPOINT, "operator")) == (place, word)


@pytest.mark.parametrize(
    ("endpoint", "alone"),
    [
        ("tcp/127.0.0.1:1", True), ("tcp/127.9.9.9:1", True), ("tcp/[::1]:1", True), ("tcp/localhost:1", True),
        ("tcp/0.0.0.0:1", False), ("tcp/[::]:1", False), ("tcp/192.0.2.1:1", False), ("tcp/no.such.host.invalid:1", False),
        ("tcp/127.0.0.1:7447#bind=0.0.0.0:1", False),
    ],
)  # fmt: skip
def test_which_endpoints_are_this_machines_alone(place: Path, endpoint: str, alone: bool) -> None:
    assert is_loopback(endpoint) == alone
    if not alone:
        with pytest.raises(Fault, match=r"NOT_SECURE: .*other computers can reach it"):
            rig_security(BusConfig(endpoint=endpoint))
        assert rig_security(BusConfig(endpoint=endpoint, insecure=True)) == {}


def test_a_name_and_its_number_are_one_rig() -> None:
    assert address("tcp/localhost:1") in {"127.0.0.1", "::1"}
    assert loopback_users.file_name("tcp/[::1]:7447") == "__1-7447.users"


def test_a_running_rig_makes_a_removed_file_again_with_its_passwords(place: Path) -> None:
    kept = loopback_users.KeptUsers(ENDPOINT)
    word = loopback_users.password(ENDPOINT, "operator")
    shutil.rmtree(place.parents[1])
    kept.keep()
    assert (place.is_file(), loopback_users.password(ENDPOINT, "operator")) == (True, word)


def test_a_missing_file_is_named_while_a_process_listens(place: Path) -> None:
    endpoint = free_endpoint()
    assert (is_free(endpoint), loopback_users.absence(endpoint)) == (True, "")
    with socket.create_server(("127.0.0.1", BusConfig(endpoint=endpoint).port)):
        assert not is_free(endpoint)
        assert f"{loopback_users.file_name(endpoint)} is in none of {place.parent}" in loopback_users.absence(endpoint)
        assert loopback_users.absence(endpoint.replace("tcp/", "tls/")) == ""
        loopback_users.make(endpoint)
        assert loopback_users.absence(endpoint) == ""


def test_without_a_password_nothing_is_dialled_before_a_process_listens(
    place: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A rig counts each attempt without its password as a refused session: its recorder and controller made 14."""

    def refuse(_config: object) -> None:
        pytest.fail("dialled")

    monkeypatch.setattr(zenoh_link.zenoh, "open", refuse)
    with pytest.raises(Fault, match="no plant answered"):
        zenoh_link.Bus(BusConfig(endpoint=free_endpoint()), "recorder", lockstep=False, patience_s=0.05)


@pytest.mark.skipif(os.name != "posix", reason="modes of files")
def test_a_key_that_others_read_is_refused(tmp_path: Path) -> None:
    from cockpit.run.authority import make_certificates

    make_certificates(tmp_path, ["rig.lab", "192.0.2.7"])
    config = BusConfig(endpoint="tls/127.0.0.1:7447", certificates=str(tmp_path))
    assert role_security(config, "viewer")["transport/link/tls/connect_private_key"] == str(tmp_path / "viewer.key")
    assert all(mode(path) == 0o600 for path in tmp_path.glob("*.key"))
    (tmp_path / "rig.key").chmod(0o640)
    with pytest.raises(Fault, match="others can read this key: its mode must be 0600; chmod 600"):
        rig_security(config)
    (tmp_path / "viewer.pem").unlink()
    with pytest.raises(Fault, match=r"viewer\.pem: no such file"):
        role_security(config, "viewer")
