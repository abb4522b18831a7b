"""The physics as a device behind the generic node make the bytes of the plant's compiled loop, so its proofs hold for a rig."""

import pytest

from bridge.arrays import Records
from bridge.guard.states import ARM
from bridge.rig.device_node import DeviceNode
from bridge.rig.faults.schedule import Faults
from bridge.wire.messages import APPLIED, sensor_block
from cockpit.run.scenario import Scenario, load_scenario
from controller.node import ControllerNode
from plant.records import guard_records
from plant.rig.device import PlantDevice
from plant.rig.exciter_faults import ExciterFaults
from plant.rig.node import PlantNode
from tests.golden.bless import situations

MORE = {
    "loop check": ["duration_s=2.2"],
    "announced": ["duration_s=1.5", "rig.drive.profile=[[0.0, 0.0], [0.5, 0.002]]", "rig.drive.announce_ahead_s=0.02"],
    "effects": ["duration_s=1.5", "rig.effects.piezo-sag.ratio=0.2"],
    "no force": ["duration_s=1.5", "rig.channels.drive_force_N.absent=true"],
}


def device_node(scenario: Scenario) -> DeviceNode:
    rig = scenario.rig
    device = PlantDevice(rig, scenario.seed)
    exciter = ExciterFaults(device.params[0])
    faults = Faults(scenario.fault, scenario.seed, device.block_s, rig.solver.samples_per_block, exciter.set)
    return DeviceNode(device, guard_records(rig, 1, scenario.arm), faults)


def played(rig: PlantNode | DeviceNode, scenario: Scenario) -> tuple[Records, Records]:
    """Sensor blocks and applied vibrations of a run with the controller; a rig that is not armed is armed at its start."""
    controller = ControllerNode(scenario.controller)
    commands: list[bytes] = []
    sensors, applied = b"", b""
    for _ in range(round(scenario.duration_s / scenario.rig.solver.block_s)):
        if not scenario.arm and rig.block == 0:
            rig.apply_order(ARM)
        messages = rig.advance(commands)
        for announcement in rig.announcements:
            controller.announcement(announcement.payload)
        command = controller.block(messages[0].payload)
        assert command is not None
        commands = [command.payload]
        sensors, applied = sensors + messages[0].payload, applied + messages[1].payload
    layout = sensor_block(scenario.rig.solver.samples_per_block)
    return layout.record(sensors), APPLIED.record(applied)


@pytest.mark.parametrize("name", [*situations(), *MORE])
def test_the_physics_as_a_device_make_the_blocks_of_the_compiled_loop(name: str) -> None:
    settings = MORE[name] if name in MORE else situations()[name]["settings"]
    settings = [*settings, *(["arm=false"] if name == "loop check" else [])]
    scenario = load_scenario("paper-c45-c45", ["controller.policy.enabled_from_s=0.0", *settings])
    node = PlantNode(scenario.rig, scenario.seed, arm=scenario.arm)
    compiled, generic = played(node, scenario), played(device_node(scenario), scenario)
    assert generic[0].tobytes() == compiled[0].tobytes()
    assert generic[1].tobytes() == compiled[1].tobytes()
    assert compiled[1]["amplitude_m"].max() > 0.0
