"""The accepted gain and the warmth outlast the rig's process, for each rig by itself."""

import math
from pathlib import Path

import pytest

from bridge.guard.kept import KeptGain, KeptHeat

TONES_HZ = [1000.0, 2000.0]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "stickslip"


def test_a_gain_is_kept_for_its_rig_and_its_tones() -> None:
    assert KeptGain("lathe", TONES_HZ, 1.0).load() == []
    KeptGain("lathe", TONES_HZ, 1.0).save([0.9, 1.1])
    assert KeptGain("lathe", TONES_HZ, 1.0).load() == [0.9, 1.1]
    assert KeptGain("lathe", [1000.0, 2500.0], 1.0).load() == []
    assert KeptGain("lathe", TONES_HZ, 0.5).load() == []  # another gain in the rig file
    assert KeptGain("mill", TONES_HZ, 1.0).load() == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"tones_Hz": [1000.0, 2000.0], "exciter_gain": 1.0, "gain": [0.0, 1.0]}',
        '{"tones_Hz": [1000.0, 2000.0], "exciter_gain": 1.0, "gain": [1.0]}',
        '{"tones_Hz": [1000.0, 2000.0], "exciter_gain": 1.0, "gain": [1.0, NaN]}',
        '{"tones_Hz": [1000.0, 2000.0], "gain": [1.0, 1.0]}',  # of a version that did not compare with the rig file
        "[" * 40000,
    ],
)
def test_a_damaged_file_yields_no_gain(text: str) -> None:
    KeptGain("lathe", TONES_HZ, 1.0).save([0.9, 1.1])
    KeptGain("lathe", TONES_HZ, 1.0).path.write_text(text)
    assert KeptGain("lathe", TONES_HZ, 1.0).load() == []


@pytest.mark.parametrize(("since_s", "left"), [(0.0, 0.9), (60.0, 0.9 / math.e), (-3600.0, 0.9), (1e9, 0.0)])
def test_the_warmth_cools_while_the_rig_is_off(monkeypatch: pytest.MonkeyPatch, since_s: float, left: float) -> None:
    """A clock that was set back cools nothing."""
    now_s = 1e9
    monkeypatch.setattr("time.time", lambda: now_s)
    assert KeptHeat("lathe", 60.0).load() == 0.0
    KeptHeat("lathe", 60.0).save(0.9)
    now_s += since_s
    assert KeptHeat("lathe", 60.0).load() == pytest.approx(left)
    assert KeptHeat("mill", 60.0).load() == 0.0


@pytest.mark.parametrize(
    "text", ["", "{}", '{"heat_share": NaN, "unix_s": 0}', '{"heat_share": -1, "unix_s": 1e12}', '{"heat_share": 0.2}']
)
def test_a_damaged_file_counts_as_hot(text: str) -> None:
    KeptHeat("lathe", 60.0).save(0.2)
    KeptHeat("lathe", 60.0).path.write_text(text)
    assert KeptHeat("lathe", 60.0).load() == 1.0
