"""The plant process: the simulated rig on the bus."""

import threading
from collections.abc import Sequence

from bridge.guard.kept import StopLatch
from bridge.plain import StepReport, no_report
from bridge.rig.faults.table import FaultTable
from bridge.rig.process import Served, serve
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.zenoh_link import BusConfig
from plant.config import RigConfig
from plant.records import notes
from plant.rig.node import PlantNode


def run(
    rig: RigConfig,
    seed: int,
    duration_s: float,
    bus_config: BusConfig,
    header: wire.Header,
    wait_for: list[str],
    lockstep: bool,
    stop: threading.Event,
    arm: bool,
    latch: StopLatch | None,
    faults: Sequence[FaultTable] = (),
    report: StepReport = no_report,
) -> int:
    """Serve the simulated rig on the bus, as `bridge.rig.process.serve`, whose faults it raises. Returns the number of blocks.

    Args:
        arm: start ARMED, if the scenario demands it.
        faults: injected into the rig and its bus.

    """

    def make(run_number: int, may_arm: bool) -> PlantNode:
        return PlantNode(rig, seed, run_number, arm and may_arm, faults)

    served = Served(rig.name, rig.guard, notes(rig), make)
    return serve(served, duration_s, bus_config, header, wait_for, lockstep, stop, latch, report)
