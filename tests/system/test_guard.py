"""A rig by itself: nothing vibrates until an operator arms it, and an operator's stop outlasts its process."""

import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from bridge.faults import FAULTS
from tests.system.ports import free_endpoint
from tests.system.run_under_way import call

COMMAND = [sys.executable, "-m", "cockpit"]

pytestmark = pytest.mark.realtime
SCENARIO = ["--scenario", "from-the-start", "--set", "duration_s=99"]


@contextmanager
def rig(
    endpoint: str, environment: dict[str, str], *more: str, before: Sequence[str] = ()
) -> Generator[subprocess.Popen[str]]:
    """A running rig, started by the words `before` and its command."""
    arguments = [*before, *COMMAND, "plant", *SCENARIO, "--wait-for", "", "--endpoint", endpoint, *more]
    process = subprocess.Popen(arguments, env=environment, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True)
    try:
        yield process
        process.send_signal(signal.SIGINT)
        process.communicate(timeout=60)
    finally:
        process.kill()
        process.communicate()


def say(word: str, endpoint: str, *options: str) -> tuple[int, dict[str, Any]]:
    """Exit status and output of an operator command, repeated until the rig is present."""
    command = [*COMMAND, word, "--json", "--endpoint", endpoint, *options]
    done = subprocess.run(command, timeout=60, check=False, capture_output=True, text=True)
    until_s = time.monotonic() + 60.0
    while done.returncode == FAULTS["NO_PEER"].exit_status and time.monotonic() < until_s:
        done = subprocess.run(command, timeout=60, check=False, capture_output=True, text=True)
    return done.returncode, json.loads(done.stdout)


def test_an_operator_arms_the_rig_and_a_stop_outlasts_its_process(tmp_path: Path) -> None:
    endpoint = free_endpoint()
    environment = os.environ | {"XDG_STATE_HOME": str(tmp_path)}
    with rig(endpoint, environment, "--set", "arm=false"):
        status, seen = say("status", endpoint)
        assert (status, seen["state"], seen["cause"]) == (1, "DISARMED", "POWER_UP")
        status, armed = say("arm", endpoint)
        assert (status, armed["state"], armed["cause"]) == (0, "ARMED", "FIRST_CHECK")
        status, stopped = say("stop", endpoint)
        assert (status, stopped["state"], stopped["cause"]) == (0, "FAULT", "STOP_BY_PERSON")
    endpoint = free_endpoint()
    with rig(endpoint, environment, "--set", "arm=true"):
        status, seen = say("status", endpoint)
        assert (seen["state"], seen["cause"]) == ("FAULT", "STOP_KEPT")
        assert say("arm", endpoint)[0] == 1
        assert say("reset", endpoint)[1]["state"] == "DISARMED"
    endpoint = free_endpoint()
    with rig(endpoint, environment, "--set", "arm=true") as process:
        assert say("status", endpoint)[1]["state"] == "ARMED"
        process.send_signal(signal.SIGSTOP)
        try:
            unheard = call("stop", "--endpoint", endpoint)
        finally:
            process.send_signal(signal.SIGCONT)
        assert unheard.returncode == FAULTS["NO_PEER"].exit_status
        assert "does not answer" in unheard.stderr
        assert "by hand" in unheard.stderr
    with rig(endpoint, environment, "--set", "arm=true", "--set", "rig.piezo.delivered_ratio=0.5"):
        assert say("status", endpoint)[1]["state"] == "ARMED"
        status, armed = say("arm", endpoint)  # the gain of the first run was kept
        assert (status, armed["state"], armed["cause"]) == (1, "READY", "GAIN_CHANGED")
        status, armed = say("arm", endpoint, "--accept-gain")
        assert (status, armed["state"], armed["cause"]) == (0, "ARMED", "GAIN_ACCEPTED")


def test_a_rig_whose_stop_could_not_be_kept_does_not_arm_itself(tmp_path: Path) -> None:
    (tmp_path / "stickslip").write_text("a file in the way")
    endpoint = free_endpoint()
    with rig(endpoint, os.environ | {"XDG_STATE_HOME": str(tmp_path)}, "--set", "arm=true"):
        assert say("status", endpoint)[1]["state"] == "DISARMED"
        status, stopped = say("stop", endpoint)
        assert (status, stopped["state"]) == (0, "FAULT")
        assert "does not outlast a restart" in stopped["not_kept"]
