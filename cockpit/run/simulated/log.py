"""The log of a run in simulated time: every message in the order of publication."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from bridge.faults import Fault
from bridge.wire.complaints import BAD_MESSAGE, Complaints
from bridge.wire.inbox import Received
from bridge.wire.topics import SENSORS
from cockpit.run.in_process import log_of
from cockpit.run.scenario import Scenario
from cockpit.run.simulated.run import SimulatedRun


def run_with_faults(
    scenario: Scenario,
    path: Path,
    about: dict[str, Any],
    progress: Callable[[float], None] | None = None,
    stopped: Callable[[], bool] = lambda: False,
) -> None:
    """Run a scenario with its faults and write its log. Raises Fault LOG_WRITE.

    Args:
        scenario: the scenario.
        path: path of the log.
        about: metadata of the run for the log.
        progress: called every 0.1 s of simulated time with that time [s].
        stopped: called at every turn; True ends the run as at its full duration.

    """
    run = SimulatedRun(scenario)
    log = log_of(scenario, path, about)
    complaints = Complaints(log.add_event)
    block_s = scenario.rig.solver.block_s
    every = max(round(0.1 / block_s), 1)
    blocks = 0

    def write(received: Received) -> None:
        nonlocal blocks
        if received.topic.logged:
            try:
                log.write(received.topic, received.payload)
            except Fault as fault:
                if fault.kind.code != "BAD_MESSAGE":
                    raise
                complaints.note(BAD_MESSAGE, received.topic.name, f"{fault.line.partition(': ')[2]}: dropped")
        if received.topic is SENSORS:
            blocks += 1
            if progress is not None and blocks % every == 0:
                progress(received.arrival_ns * 1e-9)

    run.listen(write)
    try:
        run.play(stopped)
    finally:
        log.close()
