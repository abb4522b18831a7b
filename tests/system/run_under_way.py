"""A run of several processes, started as from a terminal, for tests that disturb or end it."""

import subprocess
import sys
import time
from pathlib import Path

import pytest

from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint

COMMAND = [sys.executable, "-m", "cockpit"]


def children_of(pid: int) -> list[int]:
    """Processes whose parent is `pid`."""
    pids: list[int] = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rsplit(")", 1)[1].split()
        except OSError:
            continue
        if int(fields[1]) == pid:
            pids.append(int(stat.parent.name))
    return pids


def role(pid: int) -> str:
    """The role of a child process of a run, from its command line."""
    try:
        words = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
    except OSError:
        return ""
    return words[words.index(b"cockpit") + 1].decode() if b"cockpit" in words else ""


def gone(pid: int) -> bool:
    """Whether a process has ended."""
    try:
        return Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()[0] == "Z"
    except OSError:
        return True


class Run:
    """A run under way, its children by role."""

    def __init__(self, log: Path, *more: str, seconds: float = 30.0) -> None:
        arguments = [
            "run",
            "--set",
            f"duration_s={seconds}",
            "--endpoint",
            free_endpoint(),
            "--log",
            str(log),
            *more,
        ]
        self.process = subprocess.Popen(
            [*COMMAND, *arguments],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            start_new_session=True,
        )
        self.log = log
        self.children: dict[str, int] = {}

    def wait_until_recording(self) -> None:
        """Until two chunks are in the log."""
        until_s = time.monotonic() + PATIENCE_S
        while time.monotonic() < until_s and self.process.poll() is None:
            if self.log.exists() and self.log.stat().st_size > 200_000:
                self.children = {role(pid): pid for pid in children_of(self.process.pid)}
                assert {"plant", "controller", "recorder"} <= set(self.children)
                return
            time.sleep(0.02)
        pytest.fail(f"the run never began: {self.process.communicate(timeout=5)}")

    def wait_until_started(self) -> None:
        """Until its children are there, which have recorded nothing yet."""
        until_s = time.monotonic() + PATIENCE_S
        roles = {"plant", "controller", "recorder"}
        while set(self.children) != roles and time.monotonic() < until_s:
            self.children = {role(pid): pid for pid in children_of(self.process.pid)}
        assert set(self.children) == roles

    def end(self, within_s: float = 30.0) -> tuple[int, str, str]:
        """Status, stdout and stderr; no process may be left."""
        out, err = self.process.communicate(timeout=within_s)
        assert all(gone(pid) for pid in self.children.values())
        return self.process.returncode, out, err


def call(*arguments: str, timeout_s: float = PATIENCE_S) -> subprocess.CompletedProcess[str]:
    return subprocess.run([*COMMAND, *arguments], capture_output=True, text=True, timeout=timeout_s, check=False)
