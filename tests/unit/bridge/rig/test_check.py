"""The check of a rig finds each defect of a channel or of the device, with one remedy, and nothing on a sound rig."""

import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.arrays import Floats
from bridge.rig.check import RigCheck, check
from bridge.rig.device import Device, DeviceBlock, DeviceError, Setup
from bridge.rig.file import DeviceRig
from bridge.wire.channels import CHANNELS
from tests.unit.bridge.rig.boxes import rig_file, table

Change = Callable[[Floats, Floats], object]


class Sampler(Device):
    """A device at rest, in simulated time; `change` changes its samples in place, from the times of the samples."""

    def __init__(self, change: Change, rate: float = 1.0) -> None:
        super().__init__(Setup({}, Path(), 20_000.0, 20, 5, has_enable_line=False))
        self.now_s, self.lost, self.dropped, self.failure = 0.0, 0, "", ""
        self.gap_s = self.answer = 0.0
        self.amplitudes: set[float] = set()
        self._change, self._rate, self._blocks = change, rate, 0
        self._random = np.random.default_rng(1)

    @property
    def answer_s(self) -> float:
        return self.answer

    def open(self) -> None: ...

    def read(self) -> DeviceBlock | None:
        self.now_s += 1e-3 / self._rate + self.gap_s
        self.gap_s = 0.0
        if self.failure:
            raise DeviceError(self.failure)
        samples = 1e-3 * self._random.standard_normal((5, 20))
        samples[3:] *= 1e-3
        t_s = (self._blocks * 20 + np.arange(20)) * 5e-5
        self._blocks += 1
        self._change(samples, t_s)
        lost, self.lost = self.lost if self._blocks == 50 else 0, 0 if self._blocks == 50 else self.lost
        return DeviceBlock(
            samples,
            0.0,
            0.0,
            lost,
        )

    def problems(self) -> list[tuple[str, str]]:
        return [("DEVICE_DATA", self.dropped)] if self.dropped and self._blocks == 60 else []

    def write(self, _frequency_Hz: float, amplitude: float) -> None:
        self.amplitudes.add(amplitude)

    def safe(self) -> None: ...

    def close(self) -> None: ...


@pytest.fixture
def checked(monkeypatch: pytest.MonkeyPatch) -> Callable[..., RigCheck]:
    def made(
        change: Change = lambda _samples, _t_s: None, rig: DeviceRig | None = None, rate: float = 1.0, **facts: Any
    ) -> RigCheck:
        device = Sampler(change, rate)
        for name, value in facts.items():
            setattr(device, name, value)
        monkeypatch.setattr("bridge.rig.check.time.monotonic", lambda: device.now_s)
        result = check(device, rig or rig_file(), 2.0)
        assert device.amplitudes == {0.0}
        return result

    return made


def set_row(row: int, values: Any) -> Change:
    def change(samples: Floats, t_s: Floats) -> None:
        samples[row] = values(samples[row], t_s) if callable(values) else values

    return change


@pytest.mark.parametrize(
    ("watchdog_s", "stated_s", "answer_s", "problems", "warnings"),
    [
        (0.1, 0.0, 0.03, [], []),
        (0.1, 0.0, 0.06, ["it answers in 60 ms, so that a burst of 100 ms ends early"], []),
        (0.0, 0.1, 0.0, [], []),
        (0.0, 0.0, 0.0, [], ["it has no burst and no watchdog: a killed process leaves it on"]),
    ],
)
def test_an_exciter_that_does_not_rest_by_itself_is_a_warning(
    checked: Callable[..., RigCheck],
    watchdog_s: float,
    stated_s: float,
    answer_s: float,
    problems: list[str],
    warnings: list[str],
) -> None:
    rig = rig_file(exciter={"watchdog_s": stated_s})
    result = checked(rig=rig, watchdog_s=watchdog_s, answer=answer_s)
    assert [problem.text for problem in result.problems] == problems
    assert [warning.text for warning in result.warnings] == warnings
    assert result.ok is not bool(problems)


def test_a_derived_channel_is_checked_like_a_measured_one(checked: Callable[..., RigCheck]) -> None:
    channels = table()["channels"] | {"drive_force_N": {"derive": "2 * base_accel_mps2 + 5"}}
    result = checked(rig=rig_file(channels=channels))
    assert result.problems == []
    assert result.channels[0].mean == pytest.approx(5.0, abs=0.01)
    assert result.channels[0].noise == pytest.approx(2.0 * result.channels[2].noise)


def test_a_sound_rig_has_no_problem(checked: Callable[..., RigCheck]) -> None:
    result = checked()
    assert result.problems == []
    assert result.ok
    assert result.rate_Hz == pytest.approx(20_000.0)
    assert [row.name for row in result.channels] == list(CHANNELS)
    assert result.channels[0].noise == pytest.approx(1e-3, rel=0.02)
    assert result.in_words()[-1] == "check    ok"


@pytest.mark.parametrize("values", [0.01, lambda _x, t: np.round(500.0 * np.maximum(t - 0.5, 0.0)) * 1e-6])
def test_an_encoder_at_rest_repeats_its_number(values: Any, checked: Callable[..., RigCheck]) -> None:
    assert checked(set_row(4, values)).ok


def test_a_slip_is_no_hum(checked: Callable[..., RigCheck]) -> None:
    assert checked(set_row(1, lambda x, t: x + 5.0 * np.exp(-(((t - 1.0) / 2e-3) ** 2)))).ok


@pytest.mark.parametrize(
    ("row", "values", "text", "remedy"),
    [
        (0, 3.0, "it stays at 3", "check its plug and source"),
        (1, np.nan, "100 % of its samples are missing", "check its plug"),
        (2, lambda x, _t: np.clip(x, -1e-3, 1e-3), "% of its samples are at one end", "use a larger range"),
        (0, lambda x, t: x + 0.01 * np.sin(2.0 * np.pi * 50.0 * t), "hum of 0.0", "ground the shield"),
        (3, lambda x, _t: x + 25.0, "it reads up to 25", "correct scale"),
    ],
)
def test_a_bad_channel_is_one_problem_with_its_remedy(
    checked: Callable[..., RigCheck], row: int, values: Any, text: str, remedy: str
) -> None:
    (problem,) = checked(set_row(row, values)).problems
    assert problem.place == CHANNELS[row]
    assert text in problem.text
    assert problem.remedy.startswith(remedy) or remedy in problem.remedy


def test_a_channel_at_the_end_of_its_stated_range_is_reported(checked: Callable[..., RigCheck]) -> None:
    channels = table()["channels"] | {"drive_force_N": {"source": 0, "lowest": -50.0, "highest": 0.002}}
    (problem,) = checked(rig=rig_file(channels=channels)).problems
    assert problem.text == "it reaches the end of its range, 0.002"


def test_an_absent_channel_is_not_checked(checked: Callable[..., RigCheck]) -> None:
    channels = table()["channels"] | {"mass_accel_mps2": {"absent": True}}
    result = checked(set_row(1, 0.0), rig_file(channels=channels))
    assert result.ok
    assert "mass_accel_mps2    absent" in "\n".join(result.in_words())


@pytest.mark.parametrize(
    ("facts", "text"),
    [
        ({"rate": 1.005}, "it makes 20100 samples a second, the rig file states 20000"),
        ({"lost": 3}, "3 blocks were lost"),
        ({"dropped": "7 bytes between two frames"}, "bad data: 7 bytes between two frames"),
    ],
)
def test_a_bad_device_is_one_problem(checked: Callable[..., RigCheck], facts: dict[str, Any], text: str) -> None:
    (problem,) = checked(**facts).problems
    assert (problem.place, problem.text) == ("device", text)


def test_a_device_that_fails_is_reported_with_its_reason(checked: Callable[..., RigCheck]) -> None:
    (problem,) = checked(failure="the cable is out").problems
    assert problem.text == "the cable is out"
    (problem,) = checked(failure="the first frame has 2 numbers; set device.channels = 2").problems
    assert problem.remedy == "set device.channels = 2"


@pytest.mark.slow
def test_a_rig_that_is_no_simulation_imports_no_plant() -> None:
    code = (
        "import sys, bridge.rig.check, bridge.rig.real, bridge.rig.adapters.stream\n"
        "import cockpit.run.device_run, cockpit.commands.rig\n"
        "print([name for name in sys.modules if name.partition('.')[0] == 'plant'])"
    )
    assert subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout == "[]\n"
