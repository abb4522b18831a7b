"""A controller without an answer, while other tests may run."""

import subprocess
import sys
import threading

import pytest

from bridge.faults import FAULTS, Fault
from bridge.wire.zenoh_link import Bus, BusConfig
from cockpit.faults.injection import inject
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint
from tests.system.told import told

pytestmark = pytest.mark.slow


@pytest.mark.nightly
def test_a_command_without_a_plant_fails_with_one_line() -> None:
    command = [sys.executable, "-m", "cockpit", "controller", "--endpoint", free_endpoint()]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert result.returncode == FAULTS["NO_PEER"].exit_status
    assert "no plant answered" in result.stderr
    assert len(told(result.stderr)) == 1


def test_a_stop_without_a_rig_gives_advice_at_once() -> None:
    command = [sys.executable, "-m", "cockpit", "stop", "--endpoint", free_endpoint()]
    result = subprocess.run(command, capture_output=True, text=True, timeout=PATIENCE_S, check=False)
    assert result.returncode == FAULTS["NO_PEER"].exit_status
    assert "no rig answered at tcp" in result.stderr
    assert "cut its amplifier by hand now" in result.stderr


def test_a_controller_without_a_plant_names_the_command_to_start_one() -> None:
    config = BusConfig(endpoint=free_endpoint())
    with pytest.raises(Fault, match="no plant answered within 1 s; start `stickslip plant`") as raised:
        Bus(config, "controller", lockstep=True, patience_s=1.0)
    assert raised.value.kind is FAULTS["NO_PEER"]
    assert "--wait" not in str(raised.value)  # it waits as a command without the option does


def test_faults_are_not_reported_as_ended_where_no_rig_answers() -> None:
    endpoint = free_endpoint()
    rig = Bus(BusConfig(endpoint=endpoint, prefix="one"), "plant", lockstep=True)
    with rig, pytest.raises(Fault, match="no rig is on it: --prefix must match the run"):
        inject(BusConfig(endpoint=endpoint, prefix="other"), "clear", [], clear=True)


def test_a_signal_ends_a_command_that_waits_for_an_answer() -> None:
    stop = threading.Event()
    threading.Timer(0.5, stop.set).start()
    with pytest.raises(Fault, match="no plant answered before the stop"):
        Bus(BusConfig(endpoint=free_endpoint()), "controller", lockstep=True, stop=stop)
