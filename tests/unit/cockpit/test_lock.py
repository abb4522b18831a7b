"""The lock of a rig for tests: one owner, freed by the system, and a quarantine after a crash."""

import os
import signal
import subprocess
import sys
import threading
import time

import pytest

from bridge.faults import Fault
from cockpit.testing.lock import RigLock, release
from tests.patience import PATIENCE_S

HOLDS = "import time; from cockpit.testing.lock import RigLock\nwith RigLock('axis'): print('held', flush=True); time.sleep(600)"


def test_a_clean_end_leaves_no_mark() -> None:
    for error in (None, ValueError("a failed test"), Fault("NO_DEVICE", "axis: refused")):
        try:
            with RigLock("axis"):
                if error is not None:
                    raise error
        except (ValueError, Fault) as raised:
            assert raised is error  # noqa: PT017
    with RigLock("axis"):
        pass
    assert release("axis") == ""


def test_a_rig_that_is_not_at_rest_is_refused_until_its_release() -> None:
    with pytest.raises(Fault, match="QUARANTINED"), RigLock("axis"):
        raise Fault("QUARANTINED", "axis: vibrates")
    with pytest.raises(Fault, match=f"process {os.getpid()} of .* ended during its test"), RigLock("axis"):
        pass
    assert f"process {os.getpid()}" in release("axis")
    with RigLock("axis"):
        pass


@pytest.mark.slow
def test_a_rig_is_not_released_while_a_process_of_its_test_runs() -> None:
    with pytest.raises(Fault, match="QUARANTINED"), RigLock("axis"):
        raise Fault("QUARANTINED", "axis: vibrates")
    words = [sys.executable, "-c", "print(flush=True); input()", "--child", str(os.getpid())]
    with subprocess.Popen(words, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as child:
        assert child.stdout is not None
        child.stdout.readline()
        with pytest.raises(Fault, match=f"process {child.pid} of that test still runs"):
            release("axis")
        child.communicate(b"\n", PATIENCE_S)
    assert f"process {os.getpid()}" in release("axis")


@pytest.mark.slow
def test_a_dead_owner_frees_the_lock_and_leaves_the_quarantine(capsys: pytest.CaptureFixture[str]) -> None:
    owner = subprocess.Popen([sys.executable, "-c", HOLDS], stdout=subprocess.PIPE, text=True)
    assert owner.stdout is not None
    assert owner.stdout.readline() == "held\n"
    with pytest.raises(Fault, match="tests this rig now; wait for its end"):
        release("axis")
    refused: list[Fault] = []

    def wait() -> None:
        try:
            with RigLock("axis"):
                pass
        except Fault as fault:
            refused.append(fault)

    waiting = threading.Thread(target=wait)
    waiting.start()
    time.sleep(0.5)
    owner.send_signal(signal.SIGKILL)
    owner.wait(PATIENCE_S)
    owner.stdout.close()
    waiting.join(PATIENCE_S)
    assert [fault.kind.code for fault in refused] == ["QUARANTINED"]
    assert f"waiting  for rig axis, which process {owner.pid}" in capsys.readouterr().err
    assert f"process {owner.pid}" in release("axis")
