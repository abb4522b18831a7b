"""Each check of `rig conformance` fails for the mistake that it is meant for; right adapters pass all."""

import collections
import time as machine
from collections.abc import Callable
from typing import Any, ClassVar
from xml.etree import ElementTree as Xml

import numpy as np
import pytest

from bridge.rig.conformance import device_session
from bridge.rig.conformance.of_device import CHECKS, conformance
from bridge.rig.conformance.report import Conformance
from bridge.rig.device import Device, DeviceBlock, DeviceError
from tests.unit.bridge.rig.boxes import rig_file, table
from tests.unit.bridge.rig.right_device import WATCHDOG_S, Right, setup

Tried = Callable[..., Conformance]


@pytest.fixture
def tried(monkeypatch: pytest.MonkeyPatch) -> Tried:
    def made(adapter: type[Device], **more: Any) -> Conformance:
        values = {"exciter": {"enable_line": True, "watchdog_s": WATCHDOG_S}} | more
        rig = rig_file(**values)
        facts = setup(
            has_enable_line=rig.exciter.enable_line,
            sample_rate_Hz=rig.converter.sample_rate_Hz,
            samples_per_block=rig.converter.samples_per_block,
        )
        device: Any = adapter(facts)
        monkeypatch.setattr(device_session, "time", device.device)
        return conformance(device, rig)

    return made


def changed(**methods: Any) -> type[Right]:
    return type("Mistaken", (Right,), methods)


def samples_changed(change: Callable[[np.ndarray, int], object]) -> type[Right]:
    """An adapter that changes the samples of a block, in place, by its number."""

    def read(self: Any) -> DeviceBlock | None:
        block = Right.read(self)
        assert block is not None
        change(block.samples, self.device.made)
        return block

    return changed(read=read)


def scaled(row: int, by: float) -> type[Right]:
    return samples_changed(lambda samples, _: np.multiply(samples[row], by, out=samples[row]))


def exchanged(one: int, other: int) -> type[Right]:
    def exchange(samples: np.ndarray, _: int) -> None:
        samples[[one, other]] = samples[[other, one]]

    return samples_changed(exchange)


def ordered(change: Callable[[float, float], tuple[float, float]]) -> type[Right]:
    """An adapter that orders another vibration, and reports the order."""

    def write(self: Any, frequency_Hz: float, amplitude: float) -> None:
        self.last = frequency_Hz, amplitude
        Right.write(self, *change(frequency_Hz, amplitude))

    return changed(write=write)


class Repeats(Right):
    def read(self) -> DeviceBlock | None:
        if self.device.made % 50 == 0 and self.device.made != getattr(self, "at", 0):
            self.at = self.device.made
            return self.before
        self.before = super().read()
        return self.before


class Swaps(Right):
    held: ClassVar[list[DeviceBlock]] = []

    def read(self) -> DeviceBlock | None:
        if self.held:
            return self.held.pop()
        block = super().read()
        if self.device.made % 20 == 0 and block is not None:
            self.held.append(block)
            return super().read()
        return block


class Late(Right):
    def open(self) -> None:
        super().open()
        self.line = collections.deque([self.device.next(), self.device.next()])

    def read(self) -> DeviceBlock | None:
        block = super().read()
        assert block is not None
        self.line.append(block)
        return self.line.popleft()


class Echo(Right):
    ordered = 2000.0, 0.0

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        self.ordered = frequency_Hz, amplitude
        super().write(frequency_Hz, amplitude)

    def read(self) -> DeviceBlock | None:
        block = super().read()
        assert block is not None
        return block._replace(frequency_Hz=self.ordered[0], amplitude=self.ordered[1])


class Drops(Right):
    """It forgets the blocks that wait, without a report."""

    def read(self) -> DeviceBlock | None:
        self.device.ready.clear()
        return super().read()


class Feeds(Right):
    """Its `read` feeds the watchdog of the device."""

    def read(self) -> DeviceBlock | None:
        self.device.ordered_s = self.device.now_s
        return super().read()


class Latches(Right):
    """After `safe` it ignores orders."""

    is_safe = False

    def safe(self) -> None:
        super().safe()
        self.is_safe = True

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        super().write(frequency_Hz, 0.0 if self.is_safe else amplitude)


class OpensOnce(Right):
    times = 0

    def open(self) -> None:
        self.times += 1
        if self.times > 1:
            raise DeviceError("the address is in use")
        super().open()


class Hangs(Right):
    def read(self) -> DeviceBlock | None:
        while True:
            machine.sleep(1e-3)
            self.device.now_s += 0.05


class Lame(Right):
    """Its `write` waits for the answer of a slow generator."""

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        super().write(frequency_Hz, amplitude)
        self.device.sleep(2e-3)


def _fill(value: float | None) -> Callable[[np.ndarray, int], None]:
    def fill(samples: np.ndarray, number: int) -> None:
        if number % 40 == 0:
            samples[:, 5:9] = samples[:, 4:5] if value is None else value

    return fill


def _swap_bytes(samples: np.ndarray, _: int) -> None:
    with np.errstate(invalid="ignore"):
        samples[:] = samples.astype(">f4").view("<f4")


def _nothing(*_: object) -> None:
    pass


def _raises(*_: object) -> None:
    raise DeviceError("no")


def _never_zero(self: Any, frequency_Hz: float, amplitude: float) -> None:
    self.device.ordered_s = self.device.now_s
    if amplitude > 0.0:
        Right.write(self, frequency_Hz, amplitude)


def _turned_down(self: Any) -> None:
    self.device.order(500.0, self.device.ordered_m)


def _transposed(self: Any) -> DeviceBlock | None:
    block = Right.read(self)
    return block and block._replace(samples=block.samples.T)


def _short(self: Any) -> DeviceBlock | None:
    block = Right.read(self)
    return block and block._replace(samples=block.samples[:, :19])


def _narrow(self: Any) -> DeviceBlock | None:
    block = Right.read(self)
    return block and block._replace(samples=block.samples.astype(np.float32))


def _backwards(self: Any) -> DeviceBlock | None:
    block = Right.read(self)
    return block and block._replace(lost=-1 if self.device.made == 200 else 0)


def _loses(self: Any) -> DeviceBlock | None:
    block = Right.read(self)
    return Right.read(self) if self.device.made % 30 == 0 else block


# the mistake, the adapter, and the check that is meant
MISTAKES: dict[str, tuple[type[Right], str]] = {
    "drive counts backwards": (scaled(4, -1.0), "positions"),
    "slide counts backwards": (scaled(3, -1.0), "positions"),
    "positions exchanged": (exchanged(3, 4), "positions"),
    "drive in millimetres": (scaled(4, 1e3), "positions"),
    "slide in millimetres": (scaled(3, 1e3), "positions"),
    "force with the wrong sign": (scaled(0, -1.0), "force"),
    "slide accelerometer turned": (scaled(1, -1.0), "slide-acceleration"),
    "slide acceleration in g": (scaled(1, 1 / 9.81), "slide-acceleration"),
    "accelerometers exchanged": (exchanged(1, 2), "channels"),
    "base and force exchanged": (exchanged(0, 2), "channels"),
    "base acceleration in mm/s2": (scaled(2, 1e3), "amplitude"),
    "base acceleration in g": (scaled(2, 1 / 9.81), "amplitude"),
    "ignores orders": (changed(write=_nothing), "answers"),
    "refuses orders": (changed(write=_raises), "answers"),
    "frequency in rad/s": (ordered(lambda f, a: (f / 6.2832, a)), "frequency"),
    "frequency in rad/s, faster": (ordered(lambda f, a: (f * 1.2832, a)), "frequency"),
    "amplitude in um": (ordered(lambda f, a: (f, min(a * 1e6, 1e-7))), "amplitude"),
    "amplitude peak to peak": (ordered(lambda f, a: (f, a / 2.0)), "amplitude"),
    "vibrates after safe": (changed(safe=_nothing, close=Right.safe), "safe"),
    "safe raises": (changed(safe=_raises, close=lambda self: setattr(self, "is_open", False)), "safe"),
    "safe lowers the frequency alone": (
        changed(safe=_turned_down, close=lambda self: (Right.safe(self), setattr(self, "is_open", False))),
        "safe",
    ),
    "ignores orders after safe": (Latches, "safe"),
    "vibrates after close": (changed(close=lambda self: setattr(self, "is_open", False)), "close"),
    "cannot be opened again": (OpensOnce, "close"),
    "close raises": (changed(close=_raises), "close"),
    "does not open": (changed(open=_raises), "open"),
    "ignores an amplitude of 0": (changed(write=_never_zero), "zero"),
    "ignores the enable line": (changed(enable=_nothing), "enable"),
    "feeds the watchdog by itself": (Feeds, "watchdog"),
    "repeats blocks": (Repeats, "repeated"),
    "swaps blocks": (Swaps, "order"),
    "loses blocks silently": (changed(read=_loses), "order"),
    "drops waiting blocks": (Drops, "numbers"),
    "time goes back": (changed(read=_backwards), "numbers"),
    "late by two blocks": (Late, "answer-time"),
    "echoes the order": (Echo, "reported"),
    "wrong rate by 3 %": (changed(rate=1.03), "rate"),
    "fills with zeros": (samples_changed(_fill(0.0)), "filled"),
    "fills with the last sample": (samples_changed(_fill(None)), "filled"),
    "NaN": (samples_changed(_fill(np.nan)), "missing"),
    "a dead channel": (samples_changed(lambda samples, _: samples[0].fill(1.5)), "values"),
    "one position twice": (samples_changed(lambda samples, _: np.copyto(samples[4], samples[3])), "values"),
    "bytes in the other order": (samples_changed(_swap_bytes), "values"),
    "block too short": (changed(read=_short), "shape"),
    "samples first": (changed(read=_transposed), "shape"),
    "float32": (changed(read=_narrow), "shape"),
    "read never returns": (Hangs, "times"),
    "a slow write": (Lame, "times"),
    "vibrates at rest": (ordered(lambda f, a: (f, max(a, 5e-9))), "rest"),
}


_FIRST = {meant: mistake for mistake, (_, meant) in reversed(MISTAKES.items())}  # one for each check, in `make test`


@pytest.mark.parametrize(
    "mistake", [pytest.param(row, marks=() if row in _FIRST.values() else pytest.mark.nightly) for row in MISTAKES]
)
def test_a_mistake_fails_the_meant_check_and_at_most_one_other(mistake: str, tried: Tried) -> None:
    adapter, meant = MISTAKES[mistake]
    failed = tried(adapter).failed
    assert meant in failed
    assert len(failed) <= 2


class Volts(Right):
    """A converter of 16 bits with five channels in volts in another order, and an amplifier of 10 nm/V."""

    V_PER_SI = np.array([0.1, 0.05, 0.05, 500.0, 500.0])

    def read(self) -> DeviceBlock | None:
        block = super().read()
        assert block is not None
        volts = block.samples[::-1] * self.V_PER_SI[::-1, None]
        return block._replace(samples=np.round(volts / 3e-4) * 3e-4, amplitude=block.amplitude / 1e-8)

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        super().write(frequency_Hz, amplitude * 1e-8)


class Called(Right):
    """A simulated device without a clock, whose vibration follows at once."""

    pace = "caller"
    slew_m_per_s = 1.0
    is_ordered = False

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        self.is_ordered = True
        super().write(frequency_Hz, amplitude)

    def read(self) -> DeviceBlock | None:
        return super().read() if self.is_ordered else None

    def open(self) -> None:
        super().open()
        self.is_ordered = False


class Slow(Right):
    """Its generator takes 30 ms for a line, and executes the newest."""

    slowest_answer_s = 0.06

    def open(self) -> None:
        super().open()
        self.line: list[tuple[float, float, float]] = []

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        self.device.ordered_s = self.device.now_s
        if len(self.line) < 2:
            self.line.append((self.device.now_s, frequency_Hz, amplitude))
        else:
            self.line[1] = (self.line[1][0], frequency_Hz, amplitude)
        if self.device.now_s - self.line[0][0] >= 0.03:
            self.device.frequency_Hz, self.device.ordered_m = self.line.pop(0)[1:]


WIRED = {
    name: {"source": 4 - row, "scale": float(1.0 / Volts.V_PER_SI[row])} for row, name in enumerate(table()["channels"])
}
ABSENT = table()["channels"] | {name: {"absent": True} for name in ("drive_force_N", "mass_accel_mps2")}
DERIVED = table()["channels"] | {"drive_force_N": {"derive": "11700.0 * (drive_position_m - mass_position_m)"}}
RIGHT: dict[str, tuple[type[Right], dict[str, Any]]] = {
    "SI units": (Right, {}),
    "volts": (
        Volts,
        {"channels": WIRED, "exciter": {"enable_line": True, "watchdog_s": WATCHDOG_S, "stroke_m_per_V": 1e-8}},
    ),
    "called": (Called, {}),
    "slow": (Slow, {}),
    "at rest, without two channels and a line": (changed(moves=False), {"channels": ABSENT, "exciter": {}}),
    "with a derived force": (Right, {"channels": DERIVED}),
    "51.2 kHz": (Right, {"converter": {"sample_rate_Hz": 51_200.0, "samples_per_block": 128}}),
}


@pytest.mark.parametrize("name", RIGHT)
def test_a_right_adapter_fails_nothing(name: str, tried: Tried) -> None:
    adapter, more = RIGHT[name]
    made = tried(adapter, **more)
    assert made.failed == []
    assert sum(row.status == "skipped" for row in made.checks) <= 7


def test_there_are_25_checks_with_a_remedy_each_and_junit_lists_them(tried: Tried) -> None:
    made = tried(changed(safe=_nothing, close=Right.safe))
    assert len({row.name for row in made.checks}) == 25
    assert all(row.remedy for row in made.checks)
    suite = Xml.fromstring(made.junit())  # noqa: S314
    assert suite.attrib | {"time": ""} == {
        "name": "rig conformance box", "tests": "25", "failures": "1", "errors": "0", "skipped": "0", "time": ""
    }  # fmt: skip
    assert [case.get("name") for case in suite if case.find("failure") is not None] == ["safe"]
    assert "let `safe` end the vibration" in "\n".join(made.in_words())


def test_every_check_fails_for_some_mistake() -> None:
    assert {meant for _, meant in MISTAKES.values()} == {check.name for check in CHECKS}
