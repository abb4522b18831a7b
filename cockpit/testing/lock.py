"""The lock of a real rig for tests: one owner at a time. A rig that was not brought to rest stays QUARANTINED until its release.

The system frees the lock of a dead owner. The mark in its file stays, and shows that the rig was not brought to rest.
"""

import contextlib
import fcntl
import getpass
import json
import os
import time
from pathlib import Path
from typing import Any, Self

from bridge.faults import Fault
from bridge.guard.kept import StateFile
from bridge.plain import print_line

_LOOK_S = 0.1  # interval of the attempts to take the lock
_REPORT_S = 30.0  # interval of the lines that name its owner


def _path(rig: str) -> Path:
    return StateFile("test", rig).path


def _mark(text: str) -> dict[str, Any]:
    try:
        mark = json.loads(text)
        return {"by": str(mark["by"]), "since": str(mark["since"]), "pid": int(mark["pid"])}
    except (ValueError, TypeError, KeyError):
        return {"by": "an unknown process", "since": "an unknown time", "pid": 0}


def _children_of(pid: int) -> list[int]:
    """The living processes of a run that a process started; each is in another session and may outlive it."""
    living: list[int] = []
    for path in Path("/proc").glob("[0-9]*/cmdline"):
        with contextlib.suppress(OSError):  # it ended just now
            if path.read_bytes().endswith(f"\0--child\0{pid}\0".encode()):
                living.append(int(path.parent.name))
    return living


class RigLock:
    """The lock of one rig, as a context. It waits until the rig is free, and names the owner. Raises Fault QUARANTINED.

    Its mark is removed at the end, unless the body raises QUARANTINED: the rig is not at rest.

    Args:
        rig: name of the rig in its file.

    """

    def __init__(self, rig: str) -> None:
        self._rig = rig
        path = _path(rig)
        path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        self._file = open(path, "a+", encoding="utf-8")  # noqa: SIM115  # held from `__enter__` to `__exit__`

    def __enter__(self) -> Self:
        due_s = time.monotonic() + 2.0 * _LOOK_S
        try:
            while not self._taken():
                if time.monotonic() >= due_s:
                    print_line(
                        f"waiting  for rig {self._rig}, which {self._owner['by']} tests since {self._owner['since']}"
                    )
                    due_s = time.monotonic() + _REPORT_S
                time.sleep(_LOOK_S)
            if self._text():
                owner = self._owner
                line = f"{self._rig}: {owner['by']} ended during its test of {owner['since']} and did not bring the rig to rest"
                raise Fault("QUARANTINED", f"{line}; look at the rig, then `stickslip rig release {self._rig}`")
        except BaseException:
            self._file.close()
            raise
        who = f"process {os.getpid()} of {getpass.getuser()}"
        self._write(json.dumps({"by": who, "since": time.strftime("%Y-%m-%d %H:%M:%S"), "pid": os.getpid()}))
        return self

    def __exit__(self, _kind: object, error: BaseException | None, _trace: object) -> None:
        if not (isinstance(error, Fault) and error.kind.code == "QUARANTINED"):
            self._write("")
        self._file.close()  # frees the lock

    def _taken(self) -> bool:
        try:
            fcntl.flock(self._file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return False
        return True

    def _text(self) -> str:
        self._file.seek(0)
        return self._file.read()

    @property
    def _owner(self) -> dict[str, Any]:
        return _mark(self._text())

    def _write(self, text: str) -> None:
        self._file.seek(0)
        self._file.truncate()
        self._file.write(text)
        self._file.flush()


def release(rig: str) -> str:
    """End the quarantine of a rig; who left it, or empty.

    Raises Fault CONFIG for a rig that is being tested, or whose processes still run.
    """
    path = _path(rig)
    if not path.exists():
        return ""
    with open(path, "a+", encoding="utf-8") as file:
        file.seek(0)
        text = file.read()
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise Fault("CONFIG", f"{rig}: {_mark(text)['by']} tests this rig now; wait for its end") from None
        if living := _children_of(_mark(text)["pid"]):
            line = f"{rig}: process {', '.join(map(str, living))} of that test still runs: must have ended"
            raise Fault("CONFIG", f"{line}; end it, then release the rig")
        file.truncate(0)
    return _mark(text)["by"] if text else ""
