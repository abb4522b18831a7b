"""A rig file of a real rig: its necessary keys, its refusals, and the adapter that it names."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from bridge.config import read_toml, validate
from bridge.faults import Fault
from bridge.rig.adapters.scpi import DIALECTS
from bridge.rig.file import DeviceRig
from bridge.rig.load import device_of
from bridge.rig.real import notes, open_node
from bridge.wire.channels import CHANNELS
from tests.unit.bridge.rig.boxes import GUARD, rig_file, table, toml

ADAPTER = """
from bridge.rig.device import Device, DeviceBlock

class Adapter(Device):
    def open(self): ...
    def read(self): return None
    def write(self, frequency_Hz, amplitude): ...
    def safe(self): ...
    def close(self): ...
"""


def channels(**changed: Any) -> dict[str, Any]:
    return {name: channel for name, channel in (table()["channels"] | changed).items() if channel is not None}


@pytest.mark.parametrize(
    ("more", "line"),
    [
        (
            {"channels": channels(mass_accel_mps2=None)},
            "channels.mass_accel_mps2: missing; give its source, or absent = true",
        ),
        ({"channels": channels(mass_accel_mps2={})}, "channels.mass_accel_mps2: source, derive, absent: none given"),
        ({"channels": channels(mass_accel_mps2={"source": 1, "absent": True})}, "source and absent given: must be one"),
        ({"channels": channels(drive_force_N={"source": 1, "derive": "1"})}, "source and derive given: must be one of"),
        (
            {"channels": channels(drive_force_N={"derive": "1", "scale": 2.0})},
            "scale: a derived channel is in SI units",
        ),
        (
            {"channels": channels(drive_force_N={"derive": "k * (a"})},
            r"drive_force_N: derive: character 7 of 'k \* \(a': must be an operator or \), not its end",
        ),
        (
            {"channels": channels(drive_force_N={"derive": "k_d * mass_position_m"})},
            r"channels\.drive_force_N\.derive = 'k_d \* mass_position_m': k_d: no measured channel and no number; known: mass",
        ),
        (
            {"channels": channels(drive_position_m={"derive": "mass_position_m"})},
            "this channel must be measured: no other channel shows v_d",
        ),
        ({"numbers": {"mass_position_m": 1.0}}, r"numbers\.mass_position_m: must be a name of"),
        ({"exciter": {"device": {"burst_s": 1.0}}}, "exciter: device: settings without an adapter; give adapter"),
        ({"numbers": {"k d": 1.0}}, r"numbers\.k d: must be a name of"),
        ({"channels": channels(force={"source": 0})}, "force: no such channel; known: drive_force_N"),
        (
            {"channels": channels(drive_position_m={"absent": True})},
            "drive_position_m.absent = true: a rig needs this channel",
        ),
        ({"channels": channels(drive_force_N={"source": 0, "scale": 0.0})}, "scale = 0: must not be 0"),
        ({"guard": None}, "guard = None: must be a table"),
        ({"converter": {"sample_rate_Hz": 1000.0, "samples_per_block": 40}}, "a block of 0.04 s"),
        ({"contact": {"pair": "C45-C45 @ 0.063"}}, "contact = .*: unknown key"),
    ],
)
def test_a_wrong_rig_file_is_one_line(more: dict[str, Any], line: str) -> None:
    with pytest.raises(Fault, match=line):
        rig_file(**more)


@pytest.mark.parametrize("missing", sorted(GUARD))
def test_a_real_rig_must_state_its_absolute_limits(missing: str, tmp_path: Path) -> None:
    guard = {key: value for key, value in GUARD.items() if key != missing}
    (tmp_path / "mine.py").write_text(ADAPTER)
    with pytest.raises(Fault, match="must be given for a real rig"):
        open_node(rig_file(adapter="./mine.py", guard=guard), tmp_path, 1)


def test_an_adapter_is_a_file_next_to_the_rig_file(tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(ADAPTER)
    device = device_of(
        rig_file(adapter="./mine.py", converter={"sample_rate_Hz": 51_200.0, "samples_per_block": 64}), tmp_path
    )
    assert device.block_s == pytest.approx(1.25e-3)
    assert (device.setup.channels, device.setup.has_enable_line) == (5, True)


@pytest.mark.parametrize(
    ("text", "name", "line"),
    [
        ("", "scope", "adapter = 'scope': no such adapter; known: fmu, scpi, stream; or give a file"),
        ("import no_such_driver", "./mine.py", "needs the package no_such_driver; install it"),
        ("class Adapter: ...", "./mine.py", "must have a class Adapter that derives from"),
        ("class Adapter(", "./mine.py", "cannot be read: '\\(' was never closed"),
        ("", "./other.py", "cannot be read: .*No such file"),
    ],
)
def test_an_adapter_that_cannot_be_used_is_one_line(text: str, name: str, line: str, tmp_path: Path) -> None:
    (tmp_path / "mine.py").write_text(text)
    with pytest.raises(Fault, match=line):
        device_of(rig_file(adapter=name), tmp_path)


def test_a_separate_exciter_has_an_adapter_and_settings_of_its_own(tmp_path: Path) -> None:
    settings = {"address": "127.0.0.1:1", "dialect": "siglent-sdg", "burst_s": 0.05}
    exciter = {"adapter": "scpi", "device": settings, "stroke_m_per_V": 1e-8}
    rig = rig_file(device={"address": "127.0.0.1:1"}, exciter=exciter)
    assert device_of(rig, tmp_path).watchdog_s == 0.05
    assert "device" not in rig.header()["exciter"]
    with pytest.raises(
        Fault, match=r"exciter\.adapter = 'stream': must have a class Adapter that derives from .*Exciter"
    ):
        device_of(rig_file(device={"address": "127.0.0.1:1"}, exciter=exciter | {"adapter": "stream"}), tmp_path)
    with pytest.raises(Fault, match=r"box: 127\.0\.0\.1:1: Connection refused"):
        open_node(rig, tmp_path, 1)


def test_a_device_that_cannot_be_opened_is_an_error_and_never_a_simulation(tmp_path: Path) -> None:
    rig = rig_file(device={"address": "127.0.0.1:1"})
    with pytest.raises(Fault, match=r"box: 127\.0\.0\.1:1: Connection refused") as failed:
        open_node(rig, tmp_path, 1)
    assert failed.value.kind.code == "NO_DEVICE"


def test_lost_protection_is_noted_for_lines_and_watchdogs() -> None:
    assert [text.partition(":")[0] for code, text in notes(rig_file(exciter={})) if code == "UNPROTECTED"] == [
        "no enable line",
        "no watchdog",
    ]
    whole = rig_file(exciter={"enable_line": True, "watchdog_s": 0.1})
    assert [code for code, _ in notes(whole) if code == "UNPROTECTED"] == []


def test_the_lost_protection_of_a_derived_channel_is_noted() -> None:
    derived = channels(drive_force_N={"derive": "3 * mass_position_m"})
    assert any(
        code == "UNPROTECTED" and text.startswith("drive_force_N is derived, so that it contradicts no other channel")
        for code, text in notes(rig_file(channels=derived))
    )


def test_the_header_holds_blocks_calibration_and_limits() -> None:
    header = rig_file(device={"address": "127.0.0.1:1"}).header()
    assert header["solver"] == {"block_s": 1e-3, "samples_per_block": 20}
    assert header["channels"]["drive_force_N"]["scale"] == 1.0
    assert "device" not in header
    other = table()["channels"] | {"drive_force_N": {"source": 0, "scale": 2.0}}
    assert header["checksum"] == rig_file(device={"address": "127.0.0.1:2"}).header()["checksum"]
    assert header["checksum"] != rig_file(channels=other).header()["checksum"]


def test_a_rig_file_is_plain_toml(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text(toml(table(device={"command": ["./rig"]})))
    assert validate(DeviceRig, read_toml(path), path.name).device == {"command": ["./rig"]}


def test_the_rig_file_of_the_guide_is_valid() -> None:
    guide = (Path(__file__).parents[4] / "docs/guides/connect-a-rig.md").read_text(encoding="utf-8")
    first, derived, generator, lines = (
        tomllib.loads(part.partition("```")[0]) for part in guide.split("```toml\n")[1:]
    )
    rig = validate(DeviceRig, first, "guide")
    assert device_of(rig, Path()).setup.channels == len(CHANNELS)
    rig = validate(DeviceRig, first | derived | {"channels": first["channels"] | derived["channels"]}, "guide")
    assert list(rig.derived) == ["drive_force_N"]
    of_generator = generator["exciter"]
    rig = validate(DeviceRig, first | {"exciter": of_generator}, "guide")
    assert device_of(rig, Path()).watchdog_s == 0.1
    assert {key: DIALECTS["agilent-33500"][key] for key in ("set", "burst", "rest", "least_V")}.items() <= lines.items()
    rig = validate(
        DeviceRig, first | {"exciter": of_generator | {"device": lines | {"address": "127.0.0.1:5025"}}}, "guide"
    )
    assert device_of(rig, Path()).watchdog_s == 0.1
