"""Commands come late by whole blocks, in order, the same in lockstep, in real time and in one process."""

from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

from bridge.faults import Fault
from bridge.log.logfile import read_run
from bridge.wire.messages import APPLIED, COMMAND, NO_BLOCK
from cockpit.cli import app
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_rig, load_scenario
from controller.node import ControllerNode
from plant.inputs import RigInputs
from plant.loop_delay import LINE, whole_blocks
from plant.rig.node import PlantNode


def rig(*settings: str):
    # The amplitude identifies the command that acts; it grows beyond the exciter's range
    free = [f"guard.{limit}={{alarm=1e9,abort=1e9}}" for limit in ("loud_ratio", "velocity_mps")]
    slewing = ["piezo.amplitude_slew_m_per_s=0.0", "piezo.amplitude_max_m=0.001"]
    return load_rig("paper-c45-c45", [*free, *slewing, *settings])


def command(block: int) -> bytes:
    record = COMMAND.blank()
    record["sequence"], record["run"], record["block"] = block, 1, block
    record["frequency_Hz"], record["amplitude_m"] = 2600.0, 1e-9 * (block + 1)
    return record.tobytes()


def acting(node: PlantNode, blocks: int) -> np.ndarray:
    """Which command acts in every block, where each block is answered at once; -1 before the first."""
    result = []
    commands: list[bytes] = []
    for block in range(blocks):
        applied = APPLIED.read(node.advance(commands)[1].payload, "applied")[0]
        number = -1 if applied.command_block == NO_BLOCK else int(applied.command_block)
        assert applied.amplitude_m == pytest.approx(1e-9 * (number + 1))  # the named command acts
        assert not applied.fallback or number == -1
        result.append(number)
        commands = [command(block)]
    return np.array(result)


@pytest.mark.parametrize(
    ("delay_s", "block_s", "blocks"),
    [(0.0, 1e-3, 0), (1e-3, 1e-3, 1), (0.02, 1e-3, 20), (0.0101, 1e-3, 11), (0.05, 0.02, 3), (0.2, 0.25e-3, 800)],
)
def test_a_command_acts_whole_blocks_later(delay_s: float, block_s: float, blocks: int) -> None:
    samples = round(20e3 * block_s)
    config = rig(
        f"loop.delay_s={delay_s}",
        f"solver.block_s={block_s}",
        f"solver.samples_per_block={samples}",
        "piezo.command_timeout_s=0.3",
    )
    assert whole_blocks(delay_s, block_s) == blocks
    found = acting(PlantNode(config, 1, arm=True), blocks + 30)
    assert found.tolist() == [max(block - 1 - blocks, -1) for block in range(blocks + 30)]


def test_a_jitter_is_drawn_evenly_and_keeps_the_order() -> None:
    config = rig("loop.delay_s=0.01", "loop.jitter_s=0.02")
    delays = RigInputs(config, 5).draw(20_000).delay_blocks
    assert np.bincount(delays)[11:31] == pytest.approx(1000, rel=0.15)
    assert delays.min() == 11
    assert delays.max() == 30
    found = acting(PlantNode(config, 5, arm=True), 500)
    assert (np.diff(found) >= 0).all()
    late = np.arange(500)[40:] - found[40:] - 1
    assert late.min() >= 11
    assert late.max() <= 30
    assert len(set(late.tolist())) > 5
    other = acting(PlantNode(config, 6, arm=True), 500)
    assert not np.array_equal(found, other)


def test_noise_and_jitter_are_the_same_however_they_are_drawn() -> None:
    still, shaken = rig(), rig("loop.jitter_s=0.01")
    assert np.array_equal(RigInputs(still, 3).draw(100).noise, RigInputs(shaken, 3).draw(100).noise)
    at_once, inputs = RigInputs(shaken, 3).draw(100).delay_blocks, RigInputs(shaken, 3)
    parts = [inputs.draw(blocks).delay_blocks for blocks in (1, 30, 69)]
    assert np.array_equal(at_once, np.concatenate(parts))


def test_a_rig_that_lets_go_drops_commands_in_transit() -> None:
    node = PlantNode(rig("loop.delay_s=0.02"), 1, arm=True)
    acting(node, 10)
    node.let_go()
    for _ in range(30):
        applied = APPLIED.read(node.advance([])[1].payload, "applied")[0]
        assert applied.amplitude_m == 0.0
        assert applied.fallback == 1


@pytest.mark.slow
def test_the_delay_line_holds_the_longest_delay() -> None:
    longest = rig(
        "loop.delay_s=0.2", "loop.jitter_s=0.1", "solver.block_s=0.00025", "solver.samples_per_block=5",
        "piezo.command_timeout_s=1.0",
    )  # fmt: skip
    node = PlantNode(longest, 1, arm=True)
    found = acting(node, 3000)
    assert int(node._state["line_count"][0]) <= LINE
    assert found[-1] > 3000 - LINE


# Blocks of a number of samples that no other test uses compile plant and controller once more, 27 s of CPU: that
# kernels are kept for two lengths of a block is tested in test_kernel.py, and the plant's alone with other lengths above.
@pytest.mark.parametrize("samples", [20, pytest.param(10, marks=pytest.mark.nightly)])
def test_delay_and_jitter_make_the_same_tables_in_one_process_and_block_by_block(tmp_path: Path, samples: int) -> None:
    settings = ["duration_s=0.6", "rig.loop.delay_s=0.004", "rig.loop.jitter_s=0.006", "rig.solver.step_s=5e-6"]
    for part in ("rig.solver", "controller"):
        settings += [f"{part}.block_s=0.0005", f"{part}.samples_per_block={samples}"]
    scenario = load_scenario("from-the-start", settings)
    run_onboard(scenario, tmp_path / "run.mcap", {})
    run = read_run(tmp_path / "run.mcap")
    plant, controller = PlantNode(scenario.rig, scenario.seed, arm=True), ControllerNode(scenario.controller)
    commands: list[bytes] = []
    for block in range(1200):
        sensors, applied = plant.advance(commands)
        assert sensors.payload == run.sensors[block : block + 1].tobytes()
        assert APPLIED.read(applied.payload, "applied") == run.applied[block : block + 1]
        answer = controller.block(sensors.payload)
        assert answer is not None
        commands = [answer.payload]
    late = np.arange(1200)[80:] - 1 - run.applied["command_block"][80:].astype(int)
    assert late.min() >= 8
    assert late.max() == 20


@pytest.mark.parametrize(
    ("settings", "parts"),
    [
        (
            ["rig.loop.delay_s=0.05"],
            [
                "piezo.command_timeout_s = 0.05",
                "longer than the loop's delay",
                "loop.delay_s = 0.05",
                "0.051 s",
                "to 0.052",
            ],
        ),
        (
            ["rig.loop.delay_s=0.04", "rig.loop.jitter_s=0.02"],
            ["command_timeout_s", "loop.jitter_s = 0.02", "to 0.062"],
        ),
        (["rig.loop.delay_s=0.3"], ["rig.loop.delay_s = 0.3", "less than or equal to 0.2"]),
        (["rig.solver.block_s=0.0002"], ["rig.solver.block_s = 0.0002", "greater than or equal to 0.00025"]),
        (["controller.policy.enabled_from_s=1e300"], ["enabled_from_s = 1e+300", "less than or equal to"]),
        (["rig.solver.block_s=0.021"], ["rig.solver.block_s = 0.021", "less than or equal to 0.02"]),
    ],
)
def test_incompatible_settings_are_reported(settings: list[str], parts: list[str]) -> None:
    with pytest.raises(Fault) as caught:
        load_scenario("from-the-start", settings)
    assert all(part in caught.value.line for part in parts), caught.value.line


def test_short_blocks_run_in_one_process_and_are_refused_in_real_time(tmp_path: Path) -> None:
    parts = ["--set", "duration_s=0.2", "--log", str(tmp_path / "run.mcap"), "--set", "rig.solver.step_s=5e-6"]
    for part in ("rig.solver", "controller"):
        parts += ["--set", f"{part}.block_s=0.0005", "--set", f"{part}.samples_per_block=20"]
    result = CliRunner().invoke(app, ["run", "--scenario", "from-the-start", *parts])
    assert result.exit_code == Fault("CONFIG", "").kind.exit_status
    assert "rig.solver.block_s = 0.0005: must be 0.001 or more in real time" in result.output
    assert "--lockstep" in result.output
    CliRunner().invoke(app, ["run", "--scenario", "from-the-start", "--in-process", *parts])
    assert len(read_run(tmp_path / "run.mcap").sensors) == 400
