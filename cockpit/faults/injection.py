"""Injects a fault into a running loop: by a message to its simulated rig, or a signal to one of its processes."""

import json
import os
import signal
import subprocess
import threading
import time
import uuid
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from bridge.faults import Fault
from bridge.processes import pid_here
from bridge.rig.faults.kinds import PROCESS
from bridge.rig.faults.schedule import BEGAN
from bridge.rig.faults.table import FaultTable
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import FAULT, PLANT_EVENT
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox

_DIAL_S = 2.0  # timeout of the connection
_HEADERS_S = 2.0  # timeout for the headers of the processes
_AGAIN_S = 0.5  # interval of repetition: the first message may be lost during connection
_TWICE_S = 0.6  # time in which each order is sent twice, if no confirmation is expected
_TAKEN_S = 5.0  # timeout of the confirmation of a fault that begins at once


class Injected(NamedTuple):
    """Result of an injection."""

    endpoint: str
    name: str
    done: list[str]  # a line per fault: begun, or to begin, with its time

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        return [f"{self.name:<8} {line.removeprefix(f'{self.name}: ')}" for line in self.done]


def inject(bus_config: BusConfig, name: str, tables: Sequence[FaultTable], clear: bool = False) -> Injected:
    """Inject faults, whose times count from now, into the loop at an endpoint; with `clear` first end the active faults.

    Returns after a frozen process was continued. Raises Fault NO_PEER if no rig answers or confirms the fault, or a process
    cannot be reached.
    """
    where = bus_config.endpoint
    of_rig = [table for table in tables if table.group != PROCESS]
    of_processes = [table for table in tables if table.group == PROCESS]
    done: list[str] = []
    with Bus(bus_config, "operator", lockstep=True, patience_s=_DIAL_S) as bus:
        if (of_rig or clear) and bus.wait_for(["plant"], _HEADERS_S):
            line = f"{where}: a bus answers, but no rig is on it: --prefix must match the run"
            raise Fault("NO_PEER", f"{line}; give the --prefix of the run")
        roles = {table.target for table in of_processes}
        headers = bus.headers(roles, _HEADERS_S, threading.Event()) if roles else {}
        if missing := roles - headers.keys():
            line = f"{where}: no {' and no '.join(sorted(missing))} answers: must belong to the same run"
            raise Fault("NO_PEER", f"{line}; compare --endpoint and --prefix")
        pids = {role: pid_here(role, header.process) for role, header in headers.items()}
        if of_rig or clear:
            done += _order_rig(bus, where, of_rig, clear)
        for table in sorted(of_processes, key=lambda table: table.from_s):
            done.append(disturb(table, pids[table.target]))
    return Injected(where, name, done)


def _order_rig(bus: Bus, where: str, tables: Sequence[FaultTable], clear: bool) -> list[str]:
    """Repeat the orders until the rig confirms them."""
    events = Inbox(256)
    bus.listen(PLANT_EVENT, events.push)
    send = bus.publisher(FAULT)
    who = f"{os.environ.get('USER') or 'unknown user'} (process {os.getpid()})"
    orders = [wire.Inject(clear=True, who=who, id=uuid.uuid4().hex)] if clear else []
    for table in tables:
        text = json.dumps(table.model_dump(mode="json"))
        orders.append(wire.Inject(fault=text, who=who, id=uuid.uuid4().hex))
    waiting = {table.in_words() for table in tables if table.from_s == 0.0}
    begun_texts: list[str] = []
    began_s = time.monotonic()
    again_s = began_s
    while (now_s := time.monotonic()) < began_s + (_TAKEN_S if waiting else _TWICE_S):
        if now_s >= again_s:
            for order in orders:
                send(order.SerializeToString())
            again_s = now_s + _AGAIN_S
        received = events.get(0.05)
        if received is not None:
            event = parsed(wire.Event, received.payload, PLANT_EVENT.name)
            begun = {words for words in waiting if event.code == BEGAN and event.text.startswith(words)}
            waiting -= begun
            begun_texts += [event.text] if begun else []
    if waiting:
        line = f"{where}: no rig confirmed the fault: must be a rig with our guard in real time"
        raise Fault("NO_PEER", f"{line}; the exciter of a real rig accepts no faults")
    later = [f"{table.in_words()}, in {table.from_s:g} s" for table in tables if table.from_s > 0.0]
    return [*(["all faults are over"] if clear else []), *begun_texts, *later]


def disturb(table: FaultTable, pid: int) -> str:
    """Freeze, kill or restart a process of this computer and this user."""
    time.sleep(table.from_s)
    role = table.target
    if table.kind == "frozen":
        os.kill(pid, signal.SIGSTOP)
        try:
            time.sleep(table.for_s)
        finally:
            os.kill(pid, signal.SIGCONT)
        return f"the {role}, process {pid}, was frozen for {table.for_s:g} s"
    if table.kind == "killed":
        os.kill(pid, signal.SIGKILL)
        return f"the {role}, process {pid}, was killed"
    words = Path(f"/proc/{pid}/cmdline").read_bytes().decode(errors="surrogateescape").split("\0")[:-1]
    folder = Path(f"/proc/{pid}/cwd").readlink()
    if "--child" in words:
        line = f"the {role}, process {pid}: belongs to `stickslip run`, which ends with it: must be started by hand"
        raise Fault("CONFIG", f"{line}; start plant, controller and record as separate commands")
    os.kill(pid, signal.SIGKILL)
    time.sleep(table.for_s)
    again = subprocess.Popen(
        words, cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL,
        start_new_session=True,
    )  # fmt: skip
    return f"the {role}, process {pid}, was killed and restarted as process {again.pid}"
