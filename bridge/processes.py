"""The identity of a process: computer, pid and start time, as the system may use the pid again."""

import json
import os
import socket
from pathlib import Path

from bridge.faults import Fault

_STARTED = 19  # field of /proc/PID/stat after the name: start time in ticks since boot


def this_process() -> str:
    """The identity of the calling process as JSON: pid, host, start time."""
    return json.dumps({"pid": os.getpid(), "host": socket.gethostname(), "started": started(os.getpid())})


def pid_here(role: str, identity_text: str) -> int:
    """The pid in an identity, a text of `this_process`; `role` names the process in messages.

    Raises Fault NO_PEER for an invalid identity, and for a process that has ended or is of another computer or user.
    """
    try:
        identity = json.loads(identity_text)
        pid, host, start = int(identity["pid"]), str(identity["host"]), identity["started"]
    except (ValueError, KeyError, TypeError):
        line = f"{role}: sends no process identity: must be a process of this version; end it by hand"
        raise Fault("NO_PEER", line) from None
    if host != socket.gethostname():
        line = f"{role}: is process {pid} of {host[:64]}: must be on this computer; give the command there"
        raise Fault("NO_PEER", line)
    if start is None or started(pid) != start:
        raise Fault("NO_PEER", f"{role}: process {pid} has ended: must be running; start it again")
    owner = Path(f"/proc/{pid}").stat().st_uid
    if owner != os.getuid():
        line = f"{role}: process {pid} is of user {owner}: must be of user {os.getuid()}; give the command as that user"
        raise Fault("NO_PEER", line)
    return pid


def started(pid: int) -> int | None:
    """The start time of a process, in ticks since boot; None for an ended process."""
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[_STARTED])
    except (OSError, ValueError, IndexError):
        return None
