"""A device behind the guard: silence, refusals, lost and missing samples, calibration; its exciter rests whenever it must."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.guard.absent import absent
from bridge.guard.records import ExciterLimits, build
from bridge.guard.states import ARM
from bridge.rig.derived import Derived
from bridge.rig.device import Device, DeviceBlock, DeviceError, Setup
from bridge.rig.device_node import DeviceNode
from bridge.rig.faults.schedule import Faults
from bridge.rig.faults.table import FaultTable
from bridge.rig.real import calibration
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.clock import time
from bridge.wire.messages import COMMAND, sensor_block
from tests.unit.bridge.rig.boxes import rig_file, table

FACTS = Setup({}, Path(), 20_000.0, 20, 5, has_enable_line=False)
STEP_S = 1e-3


class Bench(Device):
    """A device whose drive moves; its base follows each order at once."""

    def __init__(self, setup: Setup = FACTS) -> None:
        super().__init__(setup)
        self.orders: list[tuple[float, float]] = []
        self.silent = self.refuses = False
        self.gone = ""
        self.lost = 0
        self.nan: set[int] = set()
        self.safes = self.opened = 0
        self._random = np.random.default_rng(1)
        self._t = 0
        self.now_s = 0.0

    def open(self) -> None:
        self.opened += 1
        if self.gone:
            raise DeviceError(self.gone)

    def read(self) -> DeviceBlock | None:
        self.now_s += 3.0 * STEP_S if self.silent else STEP_S
        if self.gone:
            raise DeviceError(self.gone)
        if self.silent:
            return None
        frequency_Hz, amplitude = self.orders[-1] if self.orders else (2600.0, 0.0)
        t_s = (self._t * 20 + np.arange(1, 21)) * 5e-5
        self._t += 1
        samples = 1e-3 * self._random.standard_normal((5, 20))
        omega = 2.0 * np.pi * frequency_Hz
        samples[2] -= amplitude * omega**2 * np.sin(omega * t_s)
        samples[3] = samples[4] = 5e-4 * t_s
        for row in self.nan:
            samples[row] = np.nan
        lost, self.lost = self.lost, 0
        return DeviceBlock(samples, frequency_Hz, amplitude, lost)

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        if self.refuses:
            raise DeviceError("busy")
        self.orders.append((frequency_Hz, amplitude))

    def safe(self) -> None:
        self.safes += 1
        self.orders.append((2600.0, 0.0))

    def close(self) -> None:
        pass


class Rig:
    """The device with its guard, under a controller that wants 30 nm."""

    def __init__(self, device: Bench, arm: bool = True, faults: tuple[FaultTable, ...] = (), **more: Any) -> None:
        rig = rig_file(**more)
        guard = build(rig.guard, ExciterLimits.of(rig.exciter, STEP_S, 20), 1, arm, absent(rig.channels), rig.derived)
        schedule = Faults(faults, 1, STEP_S, 20)
        self.device = device
        stroke_m = rig.exciter.stroke_m_per_V or 1.0
        self.node = DeviceNode(device, guard, schedule, calibration(rig), stroke_m, Derived(rig))
        self.sensors: list[Any] = []
        self.problems: list[str] = []
        self.applied_m: list[float] = []

    def run(self, blocks: int, wanted_m: float = 3e-8) -> None:
        for _ in range(blocks):
            command = COMMAND.blank()
            command["run"], command["sequence"], command["block"] = 1, self.node.block, max(self.node.block - 1, 0)
            command["frequency_Hz"], command["amplitude_m"] = 2600.0, wanted_m
            messages = self.node.advance([command.tobytes()] if self.node.block else [])
            self.problems += [code for code, _, _ in self.node.problems()]
            if messages:
                self.sensors.append(sensor_block(20).record(messages[0].payload)[0])
                self.applied_m.append(float(self.node.applied["amplitude_m"]))


@pytest.fixture
def device(monkeypatch: pytest.MonkeyPatch) -> Bench:
    made = Bench()
    monkeypatch.setattr(time, "monotonic", lambda: made.now_s)
    monkeypatch.setattr(time, "sleep", lambda for_s: setattr(made, "now_s", made.now_s + for_s))
    return made


def test_a_command_ramps_up_and_is_reported_as_the_device_executes_it(device: Bench) -> None:
    rig = Rig(device)
    rig.run(60)
    assert rig.applied_m[-1] == pytest.approx(3e-8)
    assert np.diff(rig.applied_m).max() <= 1.001e-9
    assert [int(block.sequence) for block in rig.sensors] == list(range(60))
    assert rig.problems == []


def test_a_short_silence_changes_nothing_and_a_long_one_lets_the_exciter_rest(device: Bench) -> None:
    rig = Rig(device)
    rig.run(60)
    for blocks, reports in ((10, []), (20, ["DEVICE_LATE", "DEVICE_SILENT"])):
        before = len(device.orders)
        device.silent = True
        rig.run(blocks)
        assert rig.problems == reports
        # the order for the block under way, and rest
        assert [amplitude for _, amplitude in device.orders[before:]] == pytest.approx([3e-8] + [0.0] * bool(reports))
        device.silent = False
        rig.run(40)
    assert rig.problems == ["DEVICE_LATE", "DEVICE_SILENT", "DEVICE_BACK", "SAMPLES_LOST"]
    assert max(rig.applied_m[100:103]) < 3e-9  # it began again from 0
    assert [int(block.sequence) for block in rig.sensors] == [*range(100), *range(160, 200)]


def test_a_refusal_lets_the_exciter_rest_and_begin_again_from_zero(device: Bench) -> None:
    rig = Rig(device)
    rig.run(60)
    device.refuses = True
    rig.run(1)
    device.refuses = False
    rig.run(5)
    assert rig.problems == ["DEVICE_REFUSED"]
    assert rig.applied_m[60] == 0.0
    assert rig.applied_m[61:] == pytest.approx([1e-9, 2e-9, 3e-9, 4e-9, 5e-9])


def test_an_error_of_an_adapter_ends_no_loop_and_names_its_place(device: Bench) -> None:
    rig = Rig(device)
    rig.run(60)
    read, write, safe = device.read, device.write, device.safe
    device.write = lambda *_: {}["amplitude"]
    rig.node.advance([])
    ((code, text, _),) = rig.node.problems()
    assert code == "DEVICE_REFUSED"
    assert text.startswith("test_node.py, line ")
    assert "KeyError: 'amplitude'" in text
    device.write, device.read = write, lambda: 1 / 0
    rig.run(3)
    assert rig.problems == ["DEVICE_GONE"]
    device.read, device.safe = read, lambda: 1 / 0
    rig.run(1200)
    rig.node.close()
    assert [code for code, _, _ in rig.node.problems()] == ["DEVICE_REFUSED"]
    device.safe = safe


def test_a_device_that_is_gone_is_opened_again_twice_a_second(device: Bench) -> None:
    rig = Rig(device)
    rig.run(60)
    device.gone = "the cable is out"
    rig.run(2500)
    assert 4 <= device.opened <= 5
    assert rig.problems == ["DEVICE_GONE"]
    assert device.orders[-1][1] == 0.0
    device.gone = ""
    rig.run(1000)
    assert rig.problems == ["DEVICE_GONE", "DEVICE_BACK", "SAMPLES_LOST"]


def test_lost_blocks_are_skipped_by_the_numbers(device: Bench) -> None:
    rig = Rig(device)
    rig.run(3)
    device.lost = 4
    rig.run(2)
    assert [int(block.sequence) for block in rig.sensors] == [0, 1, 2, 7, 8]
    assert [int(block.t_ns) for block in rig.sensors[-2:]] == [8_000_000, 9_000_000]
    assert rig.problems == ["SAMPLES_LOST"]


def test_missing_samples_are_never_filled(device: Bench) -> None:
    rig = Rig(device)
    device.nan = {2}
    rig.run(2)
    assert np.isnan(rig.sensors[-1].base_accel_mps2).all()
    assert np.isfinite(rig.sensors[-1].drive_force_N).all()


@pytest.mark.parametrize(
    "bad",
    [
        DeviceBlock(np.zeros((4, 20)), 2600.0, 3e-8),
        DeviceBlock(np.zeros((5, 19)), 2600.0, 3e-8),
        DeviceBlock(np.zeros(100), 2600.0, 3e-8),
        DeviceBlock(np.zeros((5, 20)), 2600.0, np.nan),
    ],
)
def test_a_block_that_is_none_is_dropped_and_reported(device: Bench, bad: DeviceBlock) -> None:
    rig = Rig(device)
    rig.run(60)
    read = device.read
    device.read = lambda: bad if read() else None
    rig.run(3)
    assert rig.problems == ["DEVICE_DATA"] * 3
    assert len(rig.sensors) == 60
    rig.run(60)
    assert "DEVICE_SILENT" in rig.problems
    assert device.orders[-1][1] == 0.0
    device.read = read
    rig.run(1)
    assert len(rig.sensors) == 61


def test_channels_are_wired_and_calibrated_and_the_exciter_takes_volts(device: Bench) -> None:
    channels = table()["channels"] | {
        "drive_force_N": {"source": 1, "scale": 50.0, "offset": 2.0, "sign": -1},
        "mass_accel_mps2": {"absent": True},
    }
    rig = Rig(device, channels=channels, exciter={"stroke_m_per_V": 1e-8})
    rig.run(60)
    raw = device._random
    assert raw is not None
    assert rig.sensors[0].drive_force_N == pytest.approx(2.0, abs=0.3)
    assert rig.sensors[0].drive_force_N.std() == pytest.approx(0.05, rel=0.6)
    assert np.array_equal(rig.sensors[0].mass_accel_mps2, np.zeros(20))
    assert device.orders[-1] == (2600.0, pytest.approx(3.0))
    assert rig.applied_m[-1] == pytest.approx(3e-8)


def test_a_channel_is_derived_from_calibrated_ones_and_never_froze(device: Bench) -> None:
    channels = table()["channels"] | {
        "drive_force_N": {"derive": "k_d * (drive_position_m - mass_position_m)"},
        "mass_position_m": {"source": 3, "scale": 2.0, "offset": 1e-3},
    }
    rig = Rig(device, arm=False, channels=channels, numbers={"k_d": 1e4})
    read, row = device.read, np.arange(5)[:, None]
    device.read = lambda: (block := read()) and block._replace(samples=np.where(row > 2, 1e-3, block.samples))
    rig.node.apply_order(ARM)
    rig.run(2)
    assert rig.sensors[-1].drive_force_N == pytest.approx(1e4 * (1e-3 - 3e-3))
    rig.run(1000)  # at standstill both positions repeat their numbers, and so does the force
    assert rig.node.applied["guard_state"] == wire.CHECKING
    device.read = lambda: (block := read()) and block._replace(samples=np.where(row == 4, np.nan, block.samples))
    rig.run(1)
    assert np.isnan(rig.sensors[-1].drive_force_N).all()


def test_without_an_enable_line_no_tone_is_ordered_while_it_would_be_off(device: Bench) -> None:
    rig = Rig(device, arm=False)
    rig.node.apply_order(ARM)
    rig.run(650)
    assert max(amplitude for _, amplitude in device.orders) == 0.0
    rig.run(1200)
    assert rig.node.applied["cause"] == wire.VIBRATION_BEGAN


def test_faults_of_sensors_act_on_any_device(device: Bench) -> None:
    fault = FaultTable(kind="off", target="drive_force_N", value=7.0, from_s=0.002)
    rig = Rig(device, faults=(fault,))
    rig.run(4)
    assert [float(block.drive_force_N[0]) == 7.0 for block in rig.sensors] == [False, False, True, True]


def test_the_end_lets_the_exciter_rest(device: Bench) -> None:
    rig = Rig(device)
    rig.run(60)
    rig.node.let_go()
    rig.run(40)
    assert rig.node.at_rest
    rig.node.close()
    assert device.safes == 1


@pytest.mark.parametrize(
    ("late_s", "code", "text"),
    [(10.0, "DEVICE_CLOCK", "20000.0 samples a second"), (10.1, "DEVICE_RATE", "wrong by this factor")],
)
def test_the_rate_of_a_device_is_measured_once(device: Bench, late_s: float, code: str, text: str) -> None:
    node = Rig(device).node
    for blocks, now_s in ((1, 0.0), (9_000, 9.0), (1_000, late_s), (1_000, late_s + 1.0)):
        device.now_s = now_s
        node._note_block(DeviceBlock(np.zeros((5, 20)), 0.0, 0.0, lost=blocks - 1))
    measured = [problem for problem in node.problems() if problem[0] != "SAMPLES_LOST"]
    assert [problem[0] for problem in measured] == [code]
    assert text in measured[0][1]
    node.advance([])  # ends a step later
    since_s = late_s + 1.0 + STEP_S
    assert float(node.applied["sample_rate_Hz"]) == pytest.approx(20.0 * 11_001 / since_s)


def test_latency_counts_from_the_end_of_the_block_to_the_answer_of_the_exciter(device: Bench) -> None:
    rig = Rig(device)
    rig.run(3)
    assert int(rig.node.applied["round_trip_ns"]) == int(rig.node.applied["answer_ns"]) == 0  # a bench without a delay
    read, write = device.read, device.write

    def slow(frequency_Hz: float, amplitude: float) -> None:
        device.now_s += 3e-4
        write(frequency_Hz, amplitude)

    device.write = slow
    rig.run(1)
    assert int(rig.node.applied["round_trip_ns"]) == pytest.approx(3e5, abs=1.0)
    assert int(rig.node.applied["answer_ns"]) == pytest.approx(3e5, abs=1.0)
    assert int(rig.node.applied["commands_late"]) == 0
    device.read = lambda: (block := read()) and block._replace(waiting=2)
    rig.run(2)  # a command for a block that two others follow acts 2 ms later
    assert int(rig.node.applied["round_trip_ns"]) == pytest.approx(2.3e6, abs=1.0)
    assert int(rig.node.applied["answer_ns"]) == pytest.approx(3e5, abs=1.0)
    assert int(rig.node.applied["commands_late"]) == 1
    assert int(rig.node.applied["late_ns"]) == 2_000_000
