"""A rig's process over the adapter `stream` against the plant's, in turns: CPU time of a block, time until its command acts."""

import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from statistics import median
from typing import NamedTuple

from bridge.wire.messages import APPLIED as LAYOUT
from bridge.wire.topics import APPLIED
from bridge.wire.zenoh_link import Bus, BusConfig, Received
from tests.system.ports import free_endpoint
from tests.unit.bridge.rig.boxes import boxed, table, toml

SECONDS, QUICK_SECONDS = 10.0, 5.0
TURNS, QUICK_TURNS = 3, 2
CPU_BAR, P50_BAR = 1.8, 1.1
_START_S = 120.0  # a first start compiles


class Figures(NamedTuple):
    """Figures of one process over some seconds."""

    cpu_us: float  # of a block
    p50_us: float  # block to command


def bench(quick: bool = False) -> bool:
    """Print the figures; whether the bars are kept."""
    seconds, turns = (QUICK_SECONDS, QUICK_TURNS) if quick else (SECONDS, TURNS)
    rigs, plants = [], []
    with tempfile.TemporaryDirectory() as name, boxed(Path(name), waits=False) as port:
        rig = Path(name) / "mine.toml"
        rig.write_text(toml(table(device={"address": f"127.0.0.1:{port}"})))
        for _ in range(turns):
            rigs.append(_figures(["--rig", str(rig)], seconds))
            plants.append(_figures(["--set", "duration_s=100"], seconds))
    print(f"\na rig over `stream` against the plant, {turns} turns of {seconds:g} s")
    kept = True
    for what, field, bar in (("CPU time of a block", 0, CPU_BAR), ("block to command, median", 1, P50_BAR)):
        ours, theirs = (median(figures[field] for figures in all_of) for all_of in (rigs, plants))
        ratio = median(rig[field] / plant[field] for rig, plant in zip(rigs, plants, strict=True))
        verdict = "PASS" if ratio <= bar else "FAIL"
        print(f"  {what}: {ours:.0f} us, the plant {theirs:.0f} us: {ratio:.2f} of it (bar {bar:g}); {verdict}")
        kept = kept and ratio <= bar
    return kept


def _figures(arguments: list[str], seconds: float) -> Figures:
    """Run a rig and its controller; the figures of the rig's process, from its second second on."""
    endpoint = free_endpoint()
    named = [*arguments, "--endpoint", endpoint]
    command = [sys.executable, "-m", "cockpit"]
    processes = [
        subprocess.Popen([*command, role, *named], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        for role in ("plant", "controller")
    ]
    heard: list[Received] = []
    try:
        with Bus(BusConfig(endpoint=endpoint, wait_s=_START_S), "viewer", lockstep=False) as link:
            link.wait_for(["plant", "controller"], _START_S)
            link.listen(APPLIED, heard.append)
            until_s = time.monotonic() + _START_S
            while len(heard) < 1000 and time.monotonic() < until_s:
                time.sleep(0.05)
            first, cpu_s = len(heard), _cpu_s(processes[0].pid)
            time.sleep(seconds)
            blocks, cpu_s = len(heard) - first, _cpu_s(processes[0].pid) - cpu_s
    finally:
        for process in processes:
            process.send_signal(signal.SIGINT)
        for process in processes:
            process.wait(_START_S)
    trips_ns = [int(LAYOUT.record(received.payload)["round_trip_ns"][0]) for received in heard[first:]]
    return Figures(1e6 * cpu_s / blocks, 1e-3 * median(trip_ns for trip_ns in trips_ns if trip_ns))


def _cpu_s(pid: int) -> float:
    fields = Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
