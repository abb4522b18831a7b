"""The identity of a process: computer, number and start, so that a later process with the same number is not taken for it."""

import json
import os
import socket
from pathlib import Path

from bridge.faults import Fault

_STARTED = 19  # field of /proc/PID/stat behind the name: ticks since the computer's start


def this_process() -> str:
    """What tells the calling process from all others, as JSON: pid, host, when it began."""
    return json.dumps({"pid": os.getpid(), "host": socket.gethostname(), "started": _started(os.getpid())})


def pid_here(role: str, told: str) -> int:
    """The pid of a process that sent the identity `told`.

    Raises Fault NO_PEER for a process without an identity, of another computer, of another user, or that is gone.
    """
    try:
        said = json.loads(told)
        pid, host, started = int(said["pid"]), str(said["host"]), said["started"]
    except (ValueError, KeyError, TypeError):
        line = f"{role}: does not tell its process: must be one of this version; end it by hand"
        raise Fault("NO_PEER", line) from None
    if host != socket.gethostname():
        line = f"{role}: is process {pid} of {host[:64]}: must be on this computer; give the command there"
        raise Fault("NO_PEER", line)
    if started is None or _started(pid) != started:
        raise Fault("NO_PEER", f"{role}: process {pid} is gone: must be there; start it again")
    owner = Path(f"/proc/{pid}").stat().st_uid
    if owner != os.getuid():
        line = f"{role}: process {pid} is of user {owner}: must be of user {os.getuid()}; give the command as that user"
        raise Fault("NO_PEER", line)
    return pid


def _started(pid: int) -> int | None:
    try:
        return int(Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[_STARTED])
    except (OSError, ValueError, IndexError):
        return None
