"""A rig in C, a program of 90 lines that we start, behind the guard and the controller."""

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from bridge.guard.states import ARM
from bridge.rig.real import open_node
from bridge.wire.messages import APPLIED, sensor_block
from bridge.wire.stickslip_pb2 import ACTIVE
from controller.config import ControllerConfig
from controller.node import ControllerNode
from tests.unit.bridge.rig.boxes import rig_file

SOURCE = Path(__file__).parents[2] / "clients/c/rig.c"
BLOCKS, CHECK_BLOCKS = 6000, 1800


@pytest.mark.skipif(shutil.which("cc") is None, reason="no C compiler")
def test_a_rig_in_c_is_armed_and_held(tmp_path: Path) -> None:
    warnings = ["-Wall", "-Wextra", "-Werror", "-std=c11"]
    subprocess.run(["cc", "-O2", *warnings, "-o", str(tmp_path / "rig"), str(SOURCE), "-lm"], check=True)
    rig = rig_file(device={"command": ["./rig", "wait"], "waits": True})
    node, controller = open_node(rig, tmp_path, 1), ControllerNode(ControllerConfig())
    sensors, applied = b"", b""
    try:
        node.apply_order(ARM)
        commands: list[bytes] = []
        for _ in range(BLOCKS):
            block, report = node.advance(commands)
            sensors, applied = sensors + block.payload, applied + report.payload
            command = controller.block(block.payload)
            commands = [command.payload] if command is not None else []
        assert node.problems() == []
    finally:
        node.close()
    held = slice(CHECK_BLOCKS + 2000, None)
    assert int(APPLIED.record(applied)["guard_state"][-1]) == ACTIVE
    force_N = sensor_block(20).record(sensors)["drive_force_N"].mean(axis=1)
    assert np.ptp(force_N[:CHECK_BLOCKS]) > 1.0  # of stick-slip
    assert np.ptp(force_N[held]) < 0.2
