"""Signals that a process receives at an inconvenient point."""

import subprocess
import sys
from pathlib import Path

import pytest

from bridge import faults

_SIGNALS_UNDER_THE_LOCK = """
import signal
from cockpit.run.child_process import stop_event

stop = stop_event()
with stop._cond:  # as within `stop.wait`, where the main thread of plant, controller and recorder spends its time
    for number in (signal.SIGTERM, signal.SIGINT, signal.SIGTERM):
        signal.raise_signal(number)
assert stop.wait(60)
"""


def test_a_signal_within_the_wait_for_it_does_not_block_the_process():
    subprocess.run([sys.executable, "-c", _SIGNALS_UNDER_THE_LOCK], check=True, timeout=60)


def test_a_missing_extra_is_installed_from_the_source_tree_in_a_checkout(monkeypatch: pytest.MonkeyPatch) -> None:
    root = Path(__file__).parents[3]
    monkeypatch.setattr(faults, "find_spec", lambda name: name)
    assert faults.install("all") == f"pip install -e '{root}[all]'"
    monkeypatch.setattr(faults, "__file__", "/usr/lib/python3/site-packages/bridge/faults.py")
    assert faults.install("all") == "pip install 'stickslip[all]'"
    monkeypatch.setattr(faults, "find_spec", lambda _name: None)
    assert faults.install("all") == "uv pip install 'stickslip[all]'"
