"""A stop without the bus, on the rig's computer: the command sets the rig's latch, and the rig confirms it in the same folder.

A rig has a file next to its latch, with its endpoint, which stays for a stop while it starts again. At rest after a stop, the rig
gives it the time of the latch, which needs no room on the disk. This module imports nothing slow: a stop calls it first.
"""

import contextlib
import json
import os
import socket
import threading
import time
from typing import Any

from bridge.faults import Fault
from bridge.guard.kept import MOST_BYTES, StateFile, StopLatch, state_folder
from bridge.processes import started

_NAME_S = 0.2  # longest search for the address of a name; longer: a stop waits for a name server that does not answer
_POLL_S = 0.01  # interval at which the confirmation is looked for


class RigFile(StateFile):
    """The file of a rig; its time repeats the time of the stop after which the rig is at rest.

    Args:
        rig: name of the rig's latch.
        endpoint: address at which the rig listens.

    """

    def __init__(self, rig: str, endpoint: str) -> None:
        super().__init__("rig", f"{rig} at {endpoint}")
        self.rig, self.endpoint = rig, endpoint

    def make(self, run: int) -> None:
        """Write the file of a rig that starts; ended rigs of its port or name lose theirs. Raises OSError, Fault LOG_WRITE."""
        for path, table in _tables():
            replaced = _port(table["endpoint"]) == _port(self.endpoint) or table["latch"] == self.rig
            if replaced and not _runs(table):
                path.unlink(missing_ok=True)
        process = {"process": os.getpid(), "started": started(os.getpid())}
        self._write({"latch": self.rig, "endpoint": self.endpoint, "run": run} | process)

    @property
    def exists(self) -> bool:
        """Whether the file exists, so that the rig takes a stop by file."""
        return os.path.lexists(self.path)

    @property
    def namesake(self) -> str:
        """The endpoint of another running rig with the same latch; empty without one."""
        others = (table for path, table in _tables() if path != self.path and table["latch"] == self.rig)
        return next((table["endpoint"] for table in others if _runs(table)), "")

    def confirm(self, set_ns: int) -> None:
        """Confirm that the rig is at rest after the stop that was set at this time. Raises OSError."""
        os.utime(self.path, ns=(set_ns, set_ns))

    @property
    def confirmed_ns(self) -> int:
        """The time of the confirmed stop; without one a time that no stop has."""
        try:
            return self.path.stat().st_mtime_ns
        except OSError:
            return -1

    def remove(self) -> None:
        """Remove the file of a rig that does not start again. Raises OSError."""
        self.path.unlink(missing_ok=True)


class StopOrder:
    """A stop of one rig of this computer.

    Args:
        rig: its file.
        who: sender of the stop.

    """

    def __init__(self, rig: RigFile, who: str) -> None:
        self._rig, self._who = rig, who
        self.rig, self.endpoint = rig.rig, rig.endpoint
        self.latch = StopLatch(rig.rig)
        self.problem = ""  # why the latch could not be set
        self._set()

    def _set(self) -> None:
        try:
            self.latch.set(self._who)
        except (OSError, Fault) as error:
            self.problem = f"{self.latch.path}: {getattr(error, 'strerror', None) or error}"

    def is_confirmed(self) -> bool:
        """Whether the rig is at rest after this stop. A latch that a simultaneous reset removed is set again."""
        set_ns = self.latch.set_ns
        if set_ns == 0 and not self.problem:
            self._set()
        return set_ns == self._rig.confirmed_ns


def order(endpoint: str, who: str) -> list[StopOrder]:
    """Stop each rig of this user at the port of an endpoint, if the endpoint is on this computer."""
    port = _port(endpoint)
    rigs = [RigFile(table["latch"], table["endpoint"]) for _, table in _tables() if _port(table["endpoint"]) == port]
    if not rigs or not _is_here(endpoint.partition("/")[2].rpartition(":")[0].strip("[]")):
        return []
    return [StopOrder(rig, who) for rig in rigs]


def confirmed(orders: list[StopOrder], timeout_s: float) -> bool:
    """Whether all rigs are at rest within this time; False without a rig."""
    until_s = time.monotonic() + timeout_s
    while not (done := all(stop.is_confirmed() for stop in orders)) and time.monotonic() < until_s:
        time.sleep(_POLL_S)
    return bool(orders) and done


def _tables() -> list[tuple[Any, dict[str, Any]]]:
    """The files of rigs and their contents, without unreadable ones."""
    tables: list[tuple[Any, dict[str, Any]]] = []
    with contextlib.suppress(OSError):
        for path in sorted(state_folder().glob("rig-*.json")):
            with contextlib.suppress(OSError, ValueError, RecursionError), open(path, "rb") as file:
                table: Any = json.loads(file.read(MOST_BYTES))
                kinds = {"latch": str, "endpoint": str, "process": int}
                if isinstance(table, dict) and all(isinstance(table.get(key), kind) for key, kind in kinds.items()):
                    tables.append((path, table))
    return tables


def _port(endpoint: str) -> str:
    return endpoint.rpartition(":")[2]


def _runs(table: dict[str, Any]) -> bool:
    return table.get("started") is not None and table["started"] == started(table["process"])


def _is_here(host: str) -> bool:
    """Whether a host is this computer; a name whose address is not known in time counts, as no command reaches its rig either."""
    addresses: list[str] = []
    known = threading.Event()

    def search() -> None:
        with contextlib.suppress(OSError, UnicodeError):
            addresses.extend(str(row[4][0]) for row in socket.getaddrinfo(host, None, type=socket.SOCK_DGRAM))
        known.set()

    threading.Thread(target=search, daemon=True).start()
    known.wait(_NAME_S)
    return not addresses or any(map(_belongs_here, addresses))


def _belongs_here(address: str) -> bool:
    """Whether an address belongs to this computer: only then a socket can be bound to it."""
    family = socket.AF_INET6 if ":" in address else socket.AF_INET
    try:
        with socket.socket(family, socket.SOCK_DGRAM) as probe:
            probe.bind((address, 0))
    except OSError:
        return False
    return True
