"""A run in one process is the nodes' run, block by block, whatever happens in between."""

from pathlib import Path

import numpy as np
import pytest

from bridge.log.logfile import RunData, read_run
from bridge.log.runlog import RunLog
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import BLOCK, RESET, STOP
from cockpit.run.in_process import TimedAction, run_onboard
from cockpit.run.scenario import Scenario, header, load_scenario
from controller.node import ControllerNode
from controller.replay import Change
from plant.rig.node import PlantNode

STOP_NS, RESET_NS, ARM_NS, CHANGE_NS = (
    333_000_000,
    421_500_000,
    450_000_000,
    587_000_000,
)  # ns; inside stretches, one between two blocks
TABLES = ("sensors", "applied", "command", "trace", "state")


def block_by_block(scenario: Scenario, log: Path, changes: list[Change], words: list[TimedAction]) -> RunData:
    """Run plant and controller as in lockstep, without a bus."""
    plant, controller = PlantNode(scenario.rig, scenario.seed, arm=True), ControllerNode(scenario.controller)
    written = RunLog(log, lockstep=True)
    for role in ("controller", "plant"):
        written.add_header(header(scenario, role, lockstep=True))
    commands: list[bytes] = []
    ahead, due = list(changes), list(words)
    while plant.block < round(scenario.duration_s * 1e3):
        t_ns = (plant.block + 1) * plant.block_ns
        for word in (word for word in due if t_ns >= word.t_ns):
            plant.apply_order(word.action)
        messages = [*plant.advance(commands)]
        while ahead and t_ns >= ahead[0].t_ns:
            controller.reconfigure(ahead.pop(0).config)
        while due and t_ns >= due[0].t_ns:
            controller.operator(due.pop(0).action)
        command = controller.block(messages[0].payload)
        assert command is not None
        commands = [command.payload]
        for message in [*messages, command, *controller.rest(0)]:
            written.write(*message)
    written.close()
    return read_run(log)


@pytest.fixture
def scenario() -> Scenario:
    return load_scenario("from-the-start", ["duration_s=1.137", "controller.policy.enabled_from_s=0.0"])


def test_stretches_make_the_messages_of_single_blocks(tmp_path: Path, scenario: Scenario) -> None:
    config = scenario.controller
    changes = [
        Change(CHANGE_NS, config.model_copy(update={"limits": config.limits.model_copy(update={"v_ratio": 1.4})}))
    ]
    stop, reset = wire.Operator.STOP, wire.Operator.RESET
    arm = wire.Operator.ARM
    words = [
        TimedAction(STOP_NS, stop),
        TimedAction(STOP_NS, reset),
        TimedAction(RESET_NS, reset),
        TimedAction(ARM_NS, arm),
    ]
    run_onboard(scenario, tmp_path / "run.mcap", {}, changes=changes, words=words)
    run = read_run(tmp_path / "run.mcap")
    expected = block_by_block(scenario, tmp_path / "blocks.mcap", changes, words)
    for name in TABLES:
        assert getattr(run, name).tobytes() == getattr(expected, name).tobytes(), name
    assert [snapshot.SerializeToString() for snapshot in run.snapshots] == [
        snapshot.SerializeToString() for snapshot in expected.snapshots
    ]
    assert len(run.snapshots) == 1
    events = run.trace["events"]
    assert {int(step): int(events[step]) for step in np.flatnonzero(events != BLOCK)} == {
        332: BLOCK | STOP,
        421: BLOCK | RESET,
    }
    assert run.trace["mode"][400] == wire.STOPPED


def test_the_log_is_in_order_of_time(tmp_path: Path, scenario: Scenario) -> None:
    from mcap.reader import NonSeekingReader

    run_onboard(scenario, tmp_path / "run.mcap", {})
    with (tmp_path / "run.mcap").open("rb") as file:
        read = NonSeekingReader(file).iter_messages(log_time_order=False)
        # scopes follow the blocks of the second that they summarise
        times = [message.log_time for _, channel, message in read if channel.topic != "/scope"]
    assert times == sorted(times)
    assert len(times) > 4 * 1137
