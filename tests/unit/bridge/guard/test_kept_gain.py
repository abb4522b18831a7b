"""The gain that was accepted outlasts the rig's process, for each rig and its tones by itself."""

from pathlib import Path

import pytest

from bridge.guard.kept import KeptGain

TONES_HZ = [1000.0, 2000.0]


@pytest.fixture(autouse=True)
def folder(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    return tmp_path / "state" / "stickslip"


def test_a_gain_is_kept_for_its_rig_and_its_tones() -> None:
    assert KeptGain("lathe", TONES_HZ).load() == []
    KeptGain("lathe", TONES_HZ).save([0.9, 1.1])
    assert KeptGain("lathe", TONES_HZ).load() == [0.9, 1.1]
    assert KeptGain("lathe", [1000.0, 2500.0]).load() == []
    assert KeptGain("mill", TONES_HZ).load() == []


@pytest.mark.parametrize(
    "text",
    [
        "",
        "[]",
        "{}",
        '{"tones_Hz": [1000.0, 2000.0], "gain": [0.0, 1.0]}',
        '{"tones_Hz": [1000.0, 2000.0], "gain": [1.0]}',
        '{"tones_Hz": [1000.0, 2000.0], "gain": [1.0, NaN]}',
        "[" * 40000,
    ],
)
def test_a_damaged_file_yields_no_gain(text: str) -> None:
    KeptGain("lathe", TONES_HZ).save([0.9, 1.1])
    KeptGain("lathe", TONES_HZ).path.write_text(text)
    assert KeptGain("lathe", TONES_HZ).load() == []
