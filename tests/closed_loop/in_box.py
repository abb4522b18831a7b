"""The loop around `stickslip rig box`, block by block: a rig file, its guard and the controller, armed at the start."""

from pathlib import Path
from typing import Any, NamedTuple

from bridge.config import validate
from bridge.guard.states import ARM
from bridge.rig.real import open_node
from bridge.wire import stickslip_pb2 as wire
from cockpit.run.device_run import DeviceRun
from controller.node import ControllerNode


class InBox(NamedTuple):
    """States of the guard and applied amplitudes by block, and the block from which the rig is armed."""

    states: list[int]
    applied_m: list[float]

    @property
    def armed(self) -> int:
        return self.states.index(wire.ARMED)


def run_in_box(folder: Path, rig: dict[str, Any], seconds: float, **controller: Any) -> InBox:
    """Run the rig of a rig file's tables, whose device waits for each command; it reports no problems."""
    run = validate(DeviceRun, {"name": "box", "rig": rig, "controller": controller}, "box")
    control, node = ControllerNode(run.controller), open_node(run.rig, folder, 1)
    made = InBox([], [])
    commands: list[bytes] = []
    try:
        node.apply_order(ARM)
        for _ in range(round(seconds / run.controller.block_s)):
            sensors, _ = node.advance(commands)
            command = control.block(sensors.payload)
            assert command is not None
            commands = [command.payload]
            made.states.append(int(node.applied["guard_state"]))
            made.applied_m.append(float(node.applied["amplitude_m"]))
        assert node.problems() == []
    finally:
        node.close()
    return made
