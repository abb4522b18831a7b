"""A rig of 51.2 kHz is controlled with nothing set by hand: its rig file sets rate and blocks of guard, node and controller."""

from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.guard.records import ExciterLimits, build
from bridge.rig.adapters import stream
from bridge.rig.device_node import DeviceNode
from bridge.rig.faults.schedule import Faults
from bridge.rig.load import device_of
from bridge.rig.real import calibration
from bridge.wire.clock import time
from cockpit.run.device_run import load_device_run
from cockpit.run.scenario import load_rig
from cockpit.run.scenario_file import rig_setting
from controller.node import ControllerNode
from tests.closed_loop.bad_device import BadDevice
from tests.unit.bridge.rig.boxes import table, toml

RATE_HZ = 51_200.0


@pytest.mark.nightly
def test_a_rig_of_51_2_kHz_is_controlled_by_its_rig_file_alone(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    samples = 64
    block_s = samples / RATE_HZ
    blocks = [f"solver.block_s={block_s}", f"solver.samples_per_block={samples}", f"solver.step_s={0.5 / RATE_HZ}"]
    device = BadDevice(load_rig("paper-c45-c45", blocks), "")
    monkeypatch.setattr(stream, "select", device)
    monkeypatch.setattr(stream, "time", device)
    path = tmp_path / "mine.toml"
    converter = {"sample_rate_Hz": RATE_HZ, "samples_per_block": samples}
    channels = table()["channels"] | {"drive_force_N": {"absent": True}}
    path.write_text(toml(table(device={"address": device.address}, converter=converter, channels=channels)))
    run, folder = load_device_run("paper-c45-c45", [rig_setting(str(path))])
    assert run.controller.block_s == block_s
    assert run.controller.estimator.use_force is False
    adapter = device_of(run.rig, folder)
    exciter = ExciterLimits.of(run.rig.exciter, block_s, samples)
    guard = build(run.rig.guard, exciter, 1, arm=True, absent=("drive_force_N",))
    with time.simulated(device.now_ns, device.sleep):
        adapter.open()
        node = DeviceNode(adapter, guard, Faults((), 1, block_s, samples), calibration(run.rig))
        controller, commands = ControllerNode(run.controller), []
        problems: list[tuple[str, str, int]] = []
        while device.now_s < 3.0:
            messages = node.advance(commands)
            problems += node.problems()
            commands = [command.payload] if messages and (command := controller.block(messages[0].payload)) else []
        node.close()
    device.close()
    ratio = np.array(device.vibration_mps)[-200:] / 5e-4
    assert problems == []
    assert ratio.min() > 1.02
    assert ratio.max() < 1.5


def test_a_block_that_no_controller_can_use_is_one_line(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    for converter, line in (
        ({"sample_rate_Hz": 51_200.0, "samples_per_block": 8}, "a block of 0.00015625 s"),
        ({"sample_rate_Hz": 4_000.0, "samples_per_block": 4}, "controller.limits.frequency_max_Hz"),
    ):
        path.write_text(toml(table(converter=converter)))
        with pytest.raises(Fault, match=line):
            load_device_run("paper-c45-c45", [rig_setting(str(path))])
