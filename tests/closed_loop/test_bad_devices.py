"""16 misbehaviours of a device behind the adapter `stream`: each is reported by its own code, and no vibration is too strong."""

import contextlib
from collections.abc import Generator
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pytest

from bridge.guard.events import GuardEvents
from bridge.guard.records import ExciterLimits, build
from bridge.rig.adapters import stream
from bridge.rig.device_node import DeviceNode
from bridge.rig.faults.schedule import Faults
from bridge.rig.load import device_of
from bridge.rig.real import calibration
from bridge.wire.clock import time
from cockpit.run.scenario import load_scenario
from controller.node import ControllerNode
from tests.closed_loop.bad_device import BadDevice
from tests.unit.bridge.rig.boxes import rig_file

BLOCKS = 2200
WITHIN_S = 1.0
MOST_RATIO, MOST_S = 1.5, 0.2  # largest v_a over its set point, and longest time above it
V_RATIO = 1.2
# the drive falls to half its speed, so that a vibration that stays would be too strong
DRIVE = "rig.drive.profile=[[0.0, 0.0005], [0.9, 0.0005], [1.0, 0.00025]]"
# the code of each, and the begin of the misbehaviour [s]
CODES = {
    "short": ("BLOCK_SHORT", 0.6),
    "repeated": ("BLOCK_REPEATED", 0.6),
    "lost": ("SAMPLES_LOST", 0.6),
    "late": ("DEVICE_LATE", 0.6),
    "NaN": ("NOT_FINITE", 0.6),
    "garbage at the start": ("DEVICE_DATA", 0.0),
    "silent for 1 s": ("DEVICE_SILENT", 0.6),
    "gone": ("DEVICE_GONE", 0.6),
    "refuses": ("DEVICE_REFUSED", 0.9),  # from the change of the drive on it matters
    "clock 3 % off": ("DEVICE_RATE", 0.0),
    "stuck": ("FROZEN", 0.6),
    "clipped": ("DEVICE_CLIPPED", 0.6),
    "swapped order": ("BLOCK_ORDER", 0.6),
    "two clients": ("DEVICE_BUSY", 0.6),
    "slow": ("DEVICE_SLOW", 0.0),
    "restarts": ("DEVICE_RESTARTED", 0.6),
}


class Outcome(NamedTuple):
    reported: dict[str, float]  # first time of each code [s]
    ratio: np.ndarray  # true v_a over its set point, per block of the device
    texts: list[str]


@contextlib.contextmanager
def driven(fault: str, monkeypatch: pytest.MonkeyPatch) -> Generator[tuple[BadDevice, DeviceNode, ControllerNode]]:
    settings = ["arm=true", "controller.policy.enabled_from_s=0.0", DRIVE]
    scenario = load_scenario("from-the-start", settings)
    device = BadDevice(scenario.rig, fault)
    monkeypatch.setattr(stream, "select", device)
    monkeypatch.setattr(stream, "time", device)
    rig = rig_file(device={"address": device.address})
    adapter = device_of(rig, Path())
    guard = build(rig.guard, ExciterLimits.of(rig.exciter, 1e-3, 20), 1, arm=True)
    with time.simulated(device.now_ns, device.sleep):
        adapter.open()
        node = DeviceNode(adapter, guard, Faults((), 1, 1e-3, 20), calibration(rig))
        yield device, node, ControllerNode(scenario.controller)
        node.close()
    device.close()


def outcome(fault: str, monkeypatch: pytest.MonkeyPatch) -> Outcome:
    reported: dict[str, float] = {}
    texts: list[str] = []
    with driven(fault, monkeypatch) as (device, node, controller):
        guard_events = GuardEvents()
        events: list[tuple[str, str, int]] = []
        controller.note = lambda code, _where, text, times=1: events.append((code, text, times))
        commands: list[bytes] = []
        while device.now_s < BLOCKS * 1e-3:
            messages = node.advance(commands)
            commands = []
            events += node.problems()
            if messages:
                events += [(*event, 1) for event in guard_events.news(node.applied)]
                command = controller.block(messages[0].payload, device.now_ns())
                commands = [command.payload] if command is not None else []
            events += [(code, text, 1) for code, text in controller.news()]
            for code, text, _ in events:
                reported.setdefault(code, device.now_s)
                texts.append(text)
            events.clear()
        v_d_mps = np.abs(np.diff(device.drive_m, prepend=0.0)) / 1e-3
        wanted_mps = V_RATIO * np.array([v_d_mps[max(i - 999, 0) : i + 1].max() for i in range(len(v_d_mps))])
        return Outcome(reported, np.array(device.vibration_mps) / wanted_mps, texts)


@pytest.mark.parametrize("fault", CODES)
def test_a_misbehaviour_has_its_own_code_and_never_leaves_a_vibration_too_strong(
    fault: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    made = outcome(fault, monkeypatch)
    code, begin_s = CODES[fault]
    assert begin_s <= made.reported[code] <= begin_s + WITHIN_S
    assert np.count_nonzero(made.ratio > MOST_RATIO) * 1e-3 <= MOST_S
    assert max(made.ratio) > (0.1 if fault == "slow" else 1.0)  # it did vibrate


def test_each_misbehaviour_has_a_code_that_no_other_needs() -> None:
    assert len({code for code, _ in CODES.values()}) == len(CODES)


def test_a_healthy_device_reports_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    made = outcome("", monkeypatch)
    assert set(made.reported) <= {"GUARD", "HELD_BACK"}
