"""A computer that stalls: nothing is lost, no sensor and no exciter is doubted for it, and no gain is learnt from it."""

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.log.logfile import RunData, read_run
from bridge.rig.faults.table import FaultTable
from bridge.wire.event_codes import TRIPS, WEAK_REASONS
from cockpit.run.scenario import load_scenario
from cockpit.run.simulated.run import run_with_faults

FROM_S = 1.0


def run(path: Path, seconds: float, *tables: dict[str, Any]) -> RunData:
    made = load_scenario("from-the-start", [f"duration_s={seconds}"])
    run_with_faults(made.model_copy(update={"fault": [FaultTable(**table) for table in tables]}), path, {})
    return read_run(path)


def blamed(data: RunData) -> Iterator[tuple[float, str, str]]:
    """Time [s], code and text of the controller's events about sensors and exciter."""
    for event in data.events:
        if event.code in (*TRIPS, *WEAK_REASONS):
            yield event.t_ns * 1e-9, event.code, event.text


@pytest.mark.parametrize(("role", "for_s"), [("controller", 0.1), ("plant", 0.5), ("controller", 1.0)])
def test_a_stall_loses_nothing_and_teaches_nothing(tmp_path: Path, role: str, for_s: float) -> None:
    """A stall of 0.1 s gave EXCITER_END, and one of 0.5 s halved the learnt gain."""
    frozen = {"kind": "frozen", "target": role, "from_s": FROM_S, "for_s": for_s}
    data = run(tmp_path / "run.mcap", FROM_S + for_s + 2.5, frozen)
    numbers = data.sensors["sequence"].astype(np.int64)
    assert (np.diff(numbers) == 1).all()
    assert data.trace["gap_blocks"].sum() == 0
    assert not {event.code for event in data.events} & {"GAP", "FLOOD", "RIG_LOST", "RESTART"}
    assert list(blamed(data)) == []
    t_s = data.trace["t_ns"] * 1e-9
    before, after = (data.trace["exciter_gain"][t_s > at_s][0] for at_s in (FROM_S - 0.1, FROM_S + for_s + 0.5))
    assert after == pytest.approx(before, rel=0.01)


@pytest.mark.parametrize("for_s", [0.067, 0.12])
def test_a_gap_in_the_commands_raises_no_vibration_and_doubts_nothing(tmp_path: Path, for_s: float) -> None:
    """A gap of 67 ms raised v_a to 1.6 set points within 3 s, and a gap of 120 ms gave OPEN_LOOP until a reset."""
    data = run(tmp_path / "run.mcap", 4.0, {"kind": "cut", "target": "commands", "from_s": FROM_S, "for_s": for_s})
    assert {event.code for event in data.events} >= {"FALLBACK"}
    assert list(blamed(data)) == []
    after = data.trace["t_ns"] * 1e-9 > FROM_S
    assert data.trace["velocity_ratio"][after].max() < 1.31


def test_an_accelerometer_that_fails_while_the_computer_stalls_all_the_time_is_reported(tmp_path: Path) -> None:
    """Stalls every 0.15 s, with 0.12 s between them."""
    stalls = [
        {"kind": "frozen", "target": "plant", "from_s": at_s, "for_s": 0.03} for at_s in np.arange(FROM_S, 3.0, 0.15)
    ]
    dead = {"kind": "off", "target": "base_accel_mps2", "from_s": FROM_S}
    blamed_stalls = list(blamed(run(tmp_path / "run.mcap", 3.0, *stalls, dead)))
    assert FROM_S < blamed_stalls[0][0] < FROM_S + 0.5


@pytest.mark.parametrize(("role", "every_s"), [("controller", 0.3), ("plant", 0.8)])
def test_a_sound_rig_is_not_doubted_though_the_computer_stalls_all_the_time(
    tmp_path: Path, role: str, every_s: float
) -> None:
    """Such stalls gave OPEN_LOOP or EXCITER_END once the longest wait was over."""
    stalls = [
        {"kind": "frozen", "target": role, "from_s": at_s, "for_s": 0.1} for at_s in np.arange(FROM_S, 6.0, every_s)
    ]
    assert list(blamed(run(tmp_path / "run.mcap", 6.0, *stalls))) == []
