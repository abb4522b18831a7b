"""The adapter `scpi` against a simulated generator, block by block: one line in flight, bursts, refusals, and its settings."""

import threading
from collections.abc import Generator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.rig.adapters import scpi
from bridge.rig.adapters.scpi import DIALECTS, Adapter
from bridge.rig.device import DeviceError, Setup
from plant.rig import generator as simulated
from plant.rig.generator import GeneratorConfig
from tests.patience import PATIENCE_S

BLOCK_S, STROKE_M = 1e-3, 7.8e-8
SETUP = Setup({}, Path(), 20_000.0, 20, 5, has_enable_line=False, in_volts=True)


class Bench:
    """The adapter and a generator, whose time is counted in blocks."""

    def __init__(self, answer_s: float, tree: str = "agilent", **settings: Any) -> None:
        self.generator = simulated.Generator(GeneratorConfig(tree=tree, answer_s=answer_s), "127.0.0.1")
        address = f"127.0.0.1:{self.generator.port}"
        dialect = next(name for name in DIALECTS if name.startswith(tree))
        self.adapter = Adapter(SETUP._replace(settings={"address": address, "dialect": dialect} | settings))
        self.block = 0
        self.delivered_V: list[float] = []
        opened = threading.Event()
        thread = threading.Thread(target=lambda: (self.adapter.open(), opened.set()))
        thread.start()
        while thread.is_alive():
            self.generator.poll(0.0, at_once=True)
        assert opened.is_set()

    def orders(self, amplitudes_V: Any, frequency_Hz: float = 2600.0) -> list[float]:
        """Order an amplitude in each block; the amplitudes that the adapter reports at the ends of the blocks."""
        reported: list[float] = []
        for amplitude_V in amplitudes_V:
            self.adapter.write(frequency_Hz, amplitude_V)
            self.wait(1)
            reported.append(self.adapter.executed[1])
        return reported

    def wait(self, blocks: int) -> None:
        for _ in range(blocks):
            self.block += 1
            now_s = self.block * BLOCK_S
            self.generator.poll(now_s, at_once=False)
            self.delivered_V.append(self.generator.vibration(now_s)[1] / STROKE_M)

    def close(self) -> None:
        self.generator.close()
        self.adapter.close()


@pytest.fixture
def clock(monkeypatch: pytest.MonkeyPatch) -> SimpleNamespace:
    """The adapter's clock, which a test sets."""
    made = SimpleNamespace(now_s=0.0)
    made.monotonic, made.sleep = lambda: made.now_s, lambda _for_s: None
    monkeypatch.setattr(scpi, "time", made)
    return made


@pytest.fixture
def benches() -> Generator[list[Bench]]:
    made: list[Bench] = []
    yield made
    for bench in made:
        bench.close()


@pytest.mark.parametrize("tree", ["agilent", "siglent"])
@pytest.mark.parametrize("answer_ms", [0, 10, 30])
def test_the_newest_order_follows_at_most_two_lines_late_and_the_acknowledged_one_is_reported(
    tree: str, answer_ms: int, benches: list[Bench]
) -> None:
    benches.append(bench := Bench(answer_ms * 1e-3, tree))
    ordered_V = 0.1 + 1e-3 * np.arange(600)  # each order is another one
    reported_V = np.array(bench.orders(ordered_V))
    delivered_V = np.array(bench.delivered_V)
    since = 2 * answer_ms + 2
    age = np.arange(since, 600) - np.searchsorted(ordered_V, delivered_V[since:] - 1e-9)
    assert age.min() >= 0
    assert age.max() <= 2 * answer_ms + 2  # and the two blocks in which a line and its answer arrive
    assert np.all(delivered_V[since:] > 0.0)  # no gap between two bursts
    assert np.allclose(reported_V[since:], delivered_V[since:])  # never the order in flight


@pytest.mark.parametrize("answer_ms", [1, 45])
def test_a_steady_vibration_has_no_gap_and_ends_by_itself_in_silence(answer_ms: int, benches: list[Bench]) -> None:
    benches.append(bench := Bench(answer_ms * 1e-3))
    bench.orders([0.3] * 400)
    assert min(bench.delivered_V[100:]) == pytest.approx(0.3)
    bench.wait(round(0.1 / BLOCK_S) + answer_ms)  # a burst, and the line in flight
    assert bench.delivered_V[-1] == 0.0


def test_rest_is_the_next_line_and_is_not_repeated(benches: list[Bench]) -> None:
    benches.append(bench := Bench(0.01))
    bench.orders([0.3] * 50)
    reported_V = bench.orders([0.0] * 50)
    assert reported_V.index(0.0) <= 20
    assert max(bench.delivered_V[70:]) == 0.0
    assert bench.adapter._flight is None
    bench.orders([3e-4] * 20)  # below the least amplitude of the generator
    assert bench.adapter._flight is None


def test_a_refusal_is_reported_and_the_generator_rests(benches: list[Bench]) -> None:
    benches.append(bench := Bench(0.002))
    bench.orders([0.3] * 20)
    with pytest.raises(DeviceError, match=r"refuses ':FREQ 2600;:VOLT 40;.*': '-222,\"Data out of range\"'"):
        bench.orders([20.0] * 20)
    bench.adapter.safe()
    assert bench.orders([0.0] * 10)[-1] == 0.0
    assert bench.delivered_V[-1] == 0.0
    assert bench.orders([0.1] * 20)[-1] == pytest.approx(0.1)


def test_the_end_brings_it_to_rest(benches: list[Bench]) -> None:
    benches.append(
        bench := Bench(0.0, burst="", set=":BURS:STAT OFF;:FREQ {frequency_Hz};:VOLT {amplitude_Vpp};:OUTP ON;*OPC?")
    )
    bench.adapter._settings = bench.adapter._settings.model_copy(update={"accepted": ["1", "+0,"]})
    bench.orders([0.3] * 5)
    bench.wait(1000)
    assert bench.delivered_V[-1] == pytest.approx(0.3)  # without bursts silence ends nothing
    thread = threading.Thread(target=bench.adapter.close)
    thread.start()
    while thread.is_alive():
        bench.wait(1)
    bench.wait(1)
    assert bench.delivered_V[-1] == 0.0
    assert bench.adapter.watchdog_s == 0.0


def test_a_generator_that_is_gone_or_silent_is_an_error(benches: list[Bench], clock: SimpleNamespace) -> None:
    benches.append(bench := Bench(0.5))
    bench.orders([0.3] * 2)
    clock.now_s = 0.9
    assert bench.adapter.executed[1] == 0.0
    clock.now_s = 1.1
    with pytest.raises(DeviceError, match=r"no answer to ':FREQ 2600;.*' within 1 s"):
        _ = bench.adapter.executed
    benches.append(other := Bench(0.0))
    other.orders([0.3])
    other.generator.close()
    other.adapter.write(2600.0, 0.4)
    with pytest.raises(DeviceError, match=r"the generator ended the connection|the connection is lost"):
        _ = other.adapter.executed


def test_one_that_cannot_be_reached_is_one_line() -> None:
    adapter = Adapter(SETUP._replace(settings={"address": "127.0.0.1:1", "dialect": "agilent-33500"}))
    with pytest.raises(DeviceError, match=r"127\.0\.0\.1:1: Connection refused"):
        adapter.open()


@pytest.mark.parametrize(
    ("settings", "line"),
    [
        ({"dialect": "other"}, "dialect = 'other': unknown; known: agilent-33500, siglent-sdg"),
        ({"address": "[::1]"}, r"address = '\[::1\]': must be HOST:PORT"),
        ({"address": "here"}, "address = 'here': must be HOST:PORT, or a VISA resource"),
        ({"set": ":FREQ {frequency_Hz}"}, "must end with a query, whose answer acknowledges it"),
        ({"burst": "*TRG {count};*OPC?"}, r"cannot be filled in \('count'\); use \{frequency_Hz\}"),
        ({"dialect": ""}, "set: missing"),
        ({"burst_s": 2.0}, "burst_s = 2.0"),
    ],
)
def test_wrong_settings_are_one_line(settings: dict[str, Any], line: str) -> None:
    with pytest.raises(Fault, match=line):
        Adapter(SETUP._replace(settings={"address": "127.0.0.1:1", "dialect": "agilent-33500"} | settings))


def test_a_rig_file_in_metres_and_a_missing_driver_are_one_line(monkeypatch: pytest.MonkeyPatch) -> None:
    settings = {"address": "127.0.0.1:1", "dialect": "siglent-sdg"}
    with pytest.raises(Fault, match=r"exciter\.stroke_m_per_V: missing"):
        Adapter(SETUP._replace(settings=settings, in_volts=False))
    monkeypatch.setattr(scpi.importlib.util, "find_spec", lambda _name: None)
    with pytest.raises(Fault, match=r"needs the package pyvisa-py; (uv )?pip install 'stickslip\[visa\]'"):
        Adapter(SETUP._replace(settings=settings | {"address": "TCPIP::10.0.0.5::INSTR"}))


def test_a_visa_driver_makes_its_calls_in_a_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    """A driver's call waits for the answer, and the loop must not."""
    asked, may_answer = list[str](), threading.Event()

    def query(line: str) -> str:
        asked.append(line)
        assert may_answer.wait(PATIENCE_S)
        return "1"

    resource = SimpleNamespace(query=query, close=lambda: asked.append("closed"))
    manager = SimpleNamespace(open_resource=lambda *_arguments, **_more: resource, close=lambda: None)
    monkeypatch.setattr(
        scpi.importlib, "import_module", lambda _name: SimpleNamespace(ResourceManager=lambda _kind: manager)
    )
    link = scpi.VisaLink("TCPIP::10.0.0.5::INSTR", 1.0)
    link.send("*OPC?")
    assert link.answer() is None
    may_answer.set()
    answer: str | None = None
    while answer is None:
        answer = link.answer()
    link.close()
    assert (answer, asked) == ("1", ["*OPC?", "closed"])
