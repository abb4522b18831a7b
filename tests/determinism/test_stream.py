"""A rig over the adapter `stream`, with its device in another process, makes the bytes of the plant's compiled loop."""

from pathlib import Path

from bridge.rig.real import open_node
from cockpit.run.scenario import load_scenario
from plant.rig.node import PlantNode
from tests.determinism.test_device import played
from tests.unit.bridge.rig.boxes import boxed, rig_file

SETTINGS = ["arm=false", "duration_s=2.2", "controller.policy.enabled_from_s=0.0"]


def test_a_device_in_another_process_makes_the_blocks_of_the_compiled_loop(tmp_path: Path) -> None:
    scenario = load_scenario(
        "paper-c45-c45",
        [*SETTINGS, "rig.guard.fastest_drive_mps=0.001", "rig.guard.velocity_mps={alarm=3e-3,abort=4e-3}"],
    )
    with boxed(tmp_path) as port:
        rig = rig_file(device={"address": f"127.0.0.1:{port}", "waits": True})
        node = open_node(rig, tmp_path, 1)
        try:
            over_the_wire = played(node, scenario)
        finally:
            node.close()
    compiled = played(PlantNode(scenario.rig, scenario.seed), scenario)
    assert over_the_wire[0].tobytes() == compiled[0].tobytes()
    assert over_the_wire[1].tobytes() == compiled[1].tobytes()
    assert compiled[1]["amplitude_m"].max() > 1e-8
    assert node.problems() == []
