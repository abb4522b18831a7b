"""Announced drive velocities are inputs of the controller: equal live, in one process and in replay."""

from pathlib import Path

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.log.logfile import RunData, read_run
from bridge.log.runlog import RunLog
from bridge.wire.messages import ANNOUNCE, ANNOUNCED, BLOCK
from cockpit.run.closed_loop import ClosedLoop
from cockpit.run.in_process import run_onboard
from cockpit.run.replay import changes_of
from cockpit.run.scenario import Scenario, header, load_scenario
from controller.announced import MOST_ANNOUNCED
from controller.node import ControllerNode
from controller.replay import replay
from plant.config import MOST_BLOCKS_AHEAD
from plant.rig.node import PlantNode
from plant.simulate import held_velocity

STROKES = [
    "rig.drive.profile=[[0.0, 0.0], [0.2, 0.002], [0.5, 0.002], [0.7, -0.002], [1.0, -0.002], [1.2, 0.0]]",
    "rig.drive.repeat_every_s=1.25",
    "rig.sensors.force_lowest_N=-50.0",
    "rig.sensors.position_lowest_m=-0.05",
    "controller.policy.enabled_from_s=0.0",
]
AHEAD_BLOCKS = 50


def strokes(*settings: str) -> Scenario:
    return load_scenario("from-the-start", [*STROKES, "duration_s=2.7", "rig.drive.announce_ahead_s=0.05", *settings])


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    path = tmp_path_factory.mktemp("announce") / "run.mcap"
    run_onboard(strokes(), path, {})
    return read_run(path)


def test_each_announcement_holds_the_velocity_of_its_time_and_arrives_in_time(run: RunData) -> None:
    announced = run.announce
    assert announced["sequence"].tolist() == list(range(len(announced)))
    assert (announced["holds_from_ns"] % 1_000_000 == 0).all()
    expected = held_velocity(strokes().rig)(announced["holds_from_ns"] * 1e-9)
    assert announced["drive_velocity_mps"] == pytest.approx(expected, abs=1e-12)
    ahead_ns = announced["holds_from_ns"] - announced["t_ns"]
    assert (ahead_ns[announced["t_ns"] > 1_000_000] == AHEAD_BLOCKS * 1_000_000).all()
    assert ahead_ns.min() >= 0
    # at every moment the newest past announcement holds
    blocks = np.arange(2, 2700)
    newest = np.searchsorted(announced["holds_from_ns"], blocks * 1_000_000, side="right") - 1
    driven = held_velocity(strokes().rig)(blocks * 1e-3)
    assert announced["drive_velocity_mps"][newest] == pytest.approx(driven, abs=2e-12)
    assert len(announced) < 2200  # none while the drive keeps its velocity


def test_the_trace_holds_the_consumed_announcements(run: RunData) -> None:
    taken = run.trace["announcements"].astype(int)
    assert taken[-1] == len(run.announce)
    new = np.diff(taken, prepend=0) > 0
    assert np.array_equal(new, run.trace["events"] & ANNOUNCED != 0)
    assert (run.trace["events"] & BLOCK != 0).all()
    # with the block before which it was sent
    assert np.array_equal(taken, np.searchsorted(run.announce["t_ns"], run.trace["t_ns"], side="right"))


def test_block_by_block_it_is_the_run_in_one_process(run: RunData, tmp_path: Path) -> None:
    scenario = strokes()
    plant, controller = PlantNode(scenario.rig, scenario.seed, arm=True), ControllerNode(scenario.controller)
    written = RunLog(tmp_path / "blocks.mcap", lockstep=True)
    for role in ("controller", "plant"):
        written.add_header(header(scenario, role, lockstep=True))
    commands: list[bytes] = []
    for _ in range(2700):
        sensors, applied = plant.advance(commands)
        for message in plant.announcements:
            controller.announcement(message.payload)
            written.write(*message)
        command = controller.block(sensors.payload)
        assert command is not None
        commands = [command.payload]
        for message in [sensors, applied, command, *controller.rest(0)]:
            written.write(*message)
    written.close()
    again = read_run(tmp_path / "blocks.mcap")
    for name in ("sensors", "applied", "command", "trace", "state", "announce"):
        assert getattr(again, name).tobytes() == getattr(run, name).tobytes(), name
    assert [snapshot.memory for snapshot in again.snapshots] == [snapshot.memory for snapshot in run.snapshots]
    assert len(run.snapshots) == 2


@pytest.mark.parametrize("from_s", [0.0, 1.5])
def test_replay_feeds_the_same_announcements(run: RunData, from_s: float) -> None:
    result = replay(run, changes_of(run, []), from_s)
    assert result.difference is None
    assert result.compared == round((2.7 - from_s) * 1e3) + (from_s > 0.0)


def test_replay_without_announcements_reports_it(run: RunData) -> None:
    result = replay(run._replace(announce=run.announce[:10]), changes_of(run, []))
    assert result.difference is not None
    assert result.difference.field == "announcements"


def test_the_ring_holds_all_that_lies_ahead() -> None:
    """Of a velocity that changes in every block, announced as far ahead as a rig may."""
    assert MOST_BLOCKS_AHEAD + 1 == MOST_ANNOUNCED
    ahead_s = f"rig.drive.announce_ahead_s={MOST_BLOCKS_AHEAD * 1e-3}"
    scenario = strokes("rig.drive.profile=[[0.0, 0.0], [100.0, 0.02]]", "rig.drive.repeat_every_s=0.0", ahead_s)
    loop = ClosedLoop(scenario.rig, 1, scenario.controller, arm=True)
    for blocks in (1, 5, 300):
        loop.advance(blocks)
        memory = loop.controller_state[0]
        assert memory["announced_count"] == loop.block + MOST_BLOCKS_AHEAD
        order = np.argsort(memory["announced_from_ns"])
        from_ns, said_mps = memory["announced_from_ns"][order], memory["announced_mps"][order]
        # the block of the next step is the oldest, and no block after it is missing
        assert from_ns.tolist() == [1_000_000 * (loop.block + block) for block in range(MOST_ANNOUNCED)]
        assert said_mps == pytest.approx(held_velocity(scenario.rig)(from_ns * 1e-9), abs=1e-15)


def test_a_rig_without_announcements_is_unchanged(tmp_path: Path) -> None:
    run_onboard(strokes("rig.drive.announce_ahead_s=0.0", "duration_s=0.3"), tmp_path / "run.mcap", {})
    run = read_run(tmp_path / "run.mcap")
    assert len(run.announce) == 0
    assert not run.trace["announcements"].any()
    assert (run.trace["events"] == BLOCK).all()


def test_too_far_ahead_is_refused() -> None:
    with pytest.raises(Fault, match=r"drive.announce_ahead_s = 0.1: must be at most 63 blocks .* shorten it to 0.063"):
        strokes("rig.drive.announce_ahead_s=0.1")


def test_an_announcement_has_the_specified_bytes() -> None:
    message = ANNOUNCE.blank()
    message["sequence"], message["t_ns"], message["holds_from_ns"] = 1, 2, 3
    assert message.tobytes().hex(" ", 1).startswith("09 01 00")
    assert len(message.tobytes()) == 36
