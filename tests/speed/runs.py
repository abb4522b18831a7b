"""Runs by the command, for benches: their results and durations."""

import json
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

from tests.system.ports import free_endpoint

_LOOK_S = 0.005
FROM_THE_START = ("--set", "controller.policy.enabled_from_s=0.0")


def start(log: Path, seconds: float, *more: str) -> "subprocess.Popen[str]":
    """A run on a separate endpoint."""
    arguments = ["--set", f"duration_s={seconds}", "--endpoint", free_endpoint(), "--log", str(log), "--json", *more]
    return subprocess.Popen(
        [sys.executable, "-m", "cockpit", "run", *arguments], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    )


def result(run: "subprocess.Popen[str]") -> dict[str, Any]:
    """Last output of a run, also of a fault."""
    out, err = run.communicate(timeout=300)
    try:
        return json.loads(out)
    except ValueError:
        raise RuntimeError(f"the run ended with status {run.returncode} and said {out!r}, {err!r}") from None


def timed(logs: list[Path], seconds: float, *more: str) -> tuple[list[dict[str, Any]], list[float]]:
    """Results of runs at the same time, and how long each recorded [s]: neither their start nor their verdict is the loop's."""
    for log in logs:
        log.unlink(missing_ok=True)
    runs = [start(log, seconds, *more) for log in logs]
    begun_s: dict[Path, float] = {}
    while len(begun_s) < len(logs) and any(run.poll() is None for run in runs):
        for log in logs:
            if log not in begun_s and log.exists() and log.stat().st_size:
                begun_s[log] = time.time()
        time.sleep(_LOOK_S)
    results = [result(run) for run in runs]
    return results, [log.stat().st_mtime - begun_s[log] for log in logs]


def bar(name: str, value: float, good: bool, rule: str) -> bool:
    """Print a figure with its bar; True if it is kept."""
    print(f"  {name:<44} {value:8.2f}   {rule:<18} {'PASS' if good else 'FAIL'}")
    return good
