"""A lockstep run in one process: the same nodes and the same log, without a bus. For tests and for many runs."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bridge.log.runlog import RunLog
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.topics import CONTROLLER_EVENT, PLANT_EVENT
from cockpit.run.scenario import Scenario, header
from controller.node import ControllerNode
from controller.replay import Change
from plant.node import PlantNode


class Word(NamedTuple):
    """An operator's STOP or RESET, of `wire.Operator.Action`, that the step at `t_ns` is to obey."""

    t_ns: int
    action: int


def run_onboard(
    scenario: Scenario,
    path: Path,
    about: dict[str, Any],
    progress: Callable[[float], None] | None = None,
    changes: Sequence[Change] = (),
    words: Sequence[Word] = (),
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Run a scenario and write its log, with a duration of 0 until it is stopped. Raises Fault LOG_WRITE.

    Args:
        progress: called now and then with the simulated time [s].
        changes: of the controller's configuration during the run, in order of time.
        words: of an operator during the run, in order of time.
        stopped: asked before every block; the run then ends as it does at its full duration.

    """
    plant = PlantNode(scenario.rig, scenario.seed)
    controller = ControllerNode(scenario.controller)
    plant.warm_up()
    controller.warm_up()
    log = RunLog(path, lockstep=True)
    log.add_metadata("run", about)
    for role in ("controller", "plant"):
        log.add_header(header(scenario, role, lockstep=True))
    blocks = round(scenario.duration_s / scenario.rig.solver.block_s) if scenario.duration_s > 0 else 2**62
    log.write(PLANT_EVENT, _event("plant", 0, 0, "START", "lockstep"))
    commands: list[bytes] = []
    ahead, to_say = list(changes), list(words)
    try:
        while plant.block < blocks and not stopped():
            sensors, applied = plant.advance(commands)
            log.write(*sensors)
            log.write(*applied)
            while ahead and plant.block * plant.block_ns >= ahead[0].t_ns:
                controller.reconfigure(ahead.pop(0).config)
            while to_say and plant.block * plant.block_ns >= to_say[0].t_ns:
                controller.operator(to_say.pop(0).action)
            command = controller.block(sensors.payload)
            if command is not None:
                log.write(*command)
                commands = [command.payload]
            for message in controller.rest(0):
                log.write(*message)
            if progress is not None and plant.block % 500 == 0:
                progress(plant.block * scenario.rig.solver.block_s)
        t_ns = plant.block * plant.block_ns
        log.write(PLANT_EVENT, _event("plant", 1, t_ns, "END", f"blocks={plant.block}"))
        text = f"steps={controller.steps} duplicates={controller.duplicates} dropped=0"
        log.write(CONTROLLER_EVENT, _event("controller", 0, t_ns, "END", text))
    finally:
        log.close()


def _event(source: str, sequence: int, t_ns: int, code: str, text: str) -> bytes:
    return wire.Event(sequence=sequence, t_ns=t_ns, source=source, code=code, text=text).SerializeToString()
