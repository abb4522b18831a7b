"""`stickslip stop` stops a rig of this computer by file before it imports or dials anything."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bridge.faults import Fault
from bridge.guard.kept import StopLatch
from bridge.guard.stop_file import RigFile
from bridge.wire.bus_config import BusConfig
from cockpit import first_stop
from cockpit.cli import app
from cockpit.live.operator import CommandOutcome, stop_rig

HERE = BusConfig().endpoint


@pytest.fixture(autouse=True)
def rig(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> RigFile:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path))
    monkeypatch.setattr(first_stop, "ordered", [])
    made = RigFile("lathe", HERE)
    made.make(1)
    RigFile("mill", "tls/127.0.0.1:7450").make(1)
    return made


@pytest.mark.parametrize(
    ("line", "rigs"),
    [
        ("stop", ["lathe"]),
        ("stop --json out.json --prefix rig --certs nowhere", ["lathe"]),
        ("stop --json -", ["lathe"]),
        ("stop --json --endpoint=tls/127.0.0.1:7450", ["mill"]),
        ("stop --scenario from-the-start", ["lathe"]),
        ("stop --scenario FILE.toml", ["mill"]),
        ("stop --endpoint", []),
        ("stop --help", []),
        ("stop --reset", []),
        ("stop --scenario no-such-scenario", []),
        ("reset", []),
        ("", []),
    ],
)
def test_the_command_line_chooses_the_rig(line: str, rigs: list[str], tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text('[bus]\nendpoint = "tls/127.0.0.1:7450"\n')
    first_stop.stop_by_file(line.replace("FILE.toml", str(scenario)).split())
    assert [rig for rig in ("lathe", "mill") if StopLatch(rig).is_set] == rigs
    assert [stop.rig for stop in first_stop.ordered] == rigs


def test_nothing_slow_is_imported_before_the_stop() -> None:
    code = "import sys; import cockpit.entry; print([m for m in ('typer', 'pydantic', 'zenoh', 'numpy') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True)
    assert done.stdout == "[]\n"


def no_bus() -> CommandOutcome:
    raise Fault("NO_PEER", "no rig answered: must run; cut its amplifier")


def test_the_confirmation_by_file_suffices(rig: RigFile) -> None:
    first_stop.stop_by_file(["stop"])
    rig.confirm(StopLatch("lathe").set_ns)
    outcome = stop_rig(no_bus, first_stop.ordered)
    assert (outcome.done, outcome.state, outcome.endpoint) == (True, "FAULT", HERE)
    assert "warning  confirmed by file, not over the bus: no rig answered: must run" in outcome.in_words()

    def full_disk() -> CommandOutcome:
        raise OSError(28, "No space left on device")

    outcome = stop_rig(full_disk, first_stop.ordered)
    assert (outcome.done, "No space left on device" in outcome.bus_problem) == (True, True)


def test_a_stop_that_no_rig_confirms_is_a_fault(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("cockpit.live.operator.BY_FILE_S", 0.0)
    first_stop.stop_by_file(["stop"])
    with pytest.raises(
        Fault,
        match=r"cut its amplifier; the stop file of the rig is set, but the rig did not confirm it: if it starts, it is in FAULT",
    ):
        stop_rig(no_bus, first_stop.ordered)
    first_stop.ordered[0].problem = "No space left on device"
    with pytest.raises(Fault, match=r"the stop file of the rig could not be set: No space left on device$"):
        stop_rig(no_bus, first_stop.ordered)
    with pytest.raises(Fault, match=r"cut its amplifier$"):
        stop_rig(no_bus, [])


def test_without_a_certificate_the_advice_is_to_cut_the_amplifier() -> None:
    def expired() -> CommandOutcome:
        raise Fault("NOT_SECURE", "operator.pem: this certificate expired")

    with pytest.raises(
        Fault, match="expired; STOP NOT DELIVERED: assume that the exciter still vibrates: cut its ampl"
    ):
        stop_rig(expired, [])


@pytest.mark.parametrize(
    ("line", "status", "after"),
    [
        ("stop --now", 2, 4),
        ("stop --json /proc/x.json", 5, 4),
        ("stop", 130, 4),
        ("stop --help", 0, 0),
        ("stop", 4, 4),
        ("status --now", 2, 2),
    ],
)
def test_a_stop_that_was_not_sent_ends_with_status_4_and_the_advice(
    line: str, status: int, after: int, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.setattr(first_stop, "answers", [])
    assert first_stop.status_of_stop(line.split(), status) == after
    assert ("STOP NOT DELIVERED: assume that the exciter" in capsys.readouterr().err) == (after != status)
    first_stop.answers.append("done")
    assert first_stop.status_of_stop(line.split(), status) == status


def test_a_stop_that_the_rig_confirmed_by_file_was_delivered(rig: RigFile, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(first_stop, "answers", [])
    first_stop.stop_by_file(["stop", "--json=x.txt"])
    rig.confirm(StopLatch("lathe").set_ns)
    assert first_stop.status_of_stop(["stop", "--json=x.txt"], 2) == 2


@pytest.mark.parametrize("options", [["--scenario", "no-such"], ["--endpoint", "tls/127.0.0.1:9", "--certs", "/none"]])
def test_a_stop_that_no_rig_confirmed_has_status_4(options: list[str], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bridge.wire.realtime.raise_priority", lambda: None)
    done = CliRunner().invoke(app, ["stop", *options])
    assert (done.exit_code, "STOP NOT DELIVERED" in done.stderr) == (4, True)


def test_after_a_confirmation_by_file_a_jammed_bus_does_not_delay_the_end(
    rig: RigFile, monkeypatch: pytest.MonkeyPatch
) -> None:
    dialled: list[float | None] = []

    def jammed(_bus: BusConfig, _word: str, dial_s: float | None) -> CommandOutcome:
        dialled.append(dial_s)
        return no_bus()

    monkeypatch.setattr("cockpit.live.operator.send_command", jammed)
    monkeypatch.setattr("bridge.wire.realtime.raise_priority", lambda: None)
    first_stop.stop_by_file(["stop"])
    monkeypatch.setattr("cockpit.live.operator.BY_FILE_S", 0.0)
    assert CliRunner().invoke(app, ["stop"]).exit_code == 4
    rig.confirm(StopLatch("lathe").set_ns)
    assert CliRunner().invoke(app, ["stop"]).exit_code == 0
    assert dialled == [None, 0.5]


def test_a_wrong_option_of_a_stop_as_json_has_the_same_status() -> None:
    done = CliRunner().invoke(app, ["stop", "--json", "--now"])
    answer = json.loads(done.stdout)
    assert (done.exit_code, answer["exit_status"], "STOP NOT DELIVERED" in answer["line"]) == (4, 4, True)
    assert CliRunner().invoke(app, ["status", "--json", "--now"]).exit_code == 2
