"""v_a over v_d at both ends, outside of stalls and the second after them."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.log.logfile import read_run
from bridge.wire.messages import APPLIED, GAP, LATE, STALE, TRACE
from bridge.wire.stickslip_pb2 import EXCITE
from cockpit.judge.ratio_watch import MOST_ABOVE_S, RatioVerdict, RatioWatch
from cockpit.judge.setup import Setup
from cockpit.judge.window import APPLIED_ROW, TRACE_ROW, JudgedBlocks, Window, rows_of
from tests.logs import verdict_of

GOLDEN = Path(__file__).parents[2] / "golden"
BLOCK_S = 1e-3
SETUP = Setup("", BLOCK_S, 0.0, 0.1, [], known_gain=False, v_ratio=1.2, duration_s=0.0)


def made(ratio: Any) -> tuple[Any, Any]:
    """Applied table of a rig and trace of a controller in EXCITE at 1 mm/s, with this v_a / v_d in each block."""
    count = len(ratio)
    trace, applied = TRACE.blank(count).copy(), APPLIED.blank(count).copy()
    for table in (trace, applied):
        table["sequence"] = np.arange(count)
        table["t_ns"] = (np.arange(count) + 1) * 1_000_000
    trace["mode"], trace["drive_velocity_mps"], trace["velocity_ratio"] = EXCITE, 1e-3, 1.2
    trace["vibration_velocity_mps"] = 1e-3 * np.asarray(ratio)
    return applied, trace


def watched(applied: Any, trace: Any, per_window: int = 2500, enabled_from_s: float = 0.0) -> RatioVerdict:
    """Watch the ratio in windows of `per_window` blocks, each with its neighbouring blocks."""
    watch, count = RatioWatch(SETUP._replace(enabled_from_s=enabled_from_s)), len(trace)
    blocks = JudgedBlocks(*(np.asarray(trace["sequence"]), np.asarray(trace["t_ns"]), *[np.empty(0)] * 5))
    rows = rows_of(trace, TRACE_ROW), rows_of(applied, APPLIED_ROW)
    for first in range(0, count, per_window):
        end = min(first + per_window, count)
        watch.add(Window(blocks, *rows, first, end, 0, False, 0, is_last=end == count))
    return watch.result()


@pytest.mark.parametrize("name", sorted(path.stem for path in GOLDEN.glob("*.mcap")))
def test_a_sound_run_is_ok_in_windows_of_any_size(name: str) -> None:
    run = read_run(GOLDEN / f"{name}.mcap")
    seen = verdict_of(run).ratio
    assert seen is not None
    assert seen.ok
    pieces = (watched(run.applied, run.trace, per_window=rows) for rows in (701, 100_000))
    assert all(piece.highest == pytest.approx(next(pieces).highest) for piece in pieces)


def stretch(of_s: float, ratio: float) -> Any:
    values = np.full(6000, 1.2)
    values[4000 : 4000 + round(of_s / BLOCK_S)] = ratio
    return values


@pytest.mark.parametrize(("of_s", "ok"), [(MOST_ABOVE_S - 0.01, True), (MOST_ABOVE_S + 0.01, False)])
def test_above_one_and_a_half_set_points_for_long_is_not_ok(of_s: float, ok: bool) -> None:
    seen = watched(*made(stretch(of_s, 3.18)))
    assert seen.ok is ok
    assert seen.highest == pytest.approx(3.18)
    assert seen.longest_above_s == pytest.approx(of_s, abs=2e-3)
    assert ("above 1.5 set points" in seen.in_words()) is not ok


@pytest.mark.parametrize("per_window", [701, 6000])
def test_a_set_point_that_the_controller_raised_after_a_slip_or_surge_is_the_set_point(per_window: int) -> None:
    """Raised without one, after gaps in the commands, it hid 2.4 set points."""
    applied, trace = made(stretch(1.0, 2.4))
    trace["slips"] = 7  # before the controller was enabled
    trace["velocity_ratio"] = 2.4
    assert not watched(applied, trace, per_window, enabled_from_s=1.0).ok
    trace["surges"][3900:] = 1
    assert watched(applied, trace, per_window, enabled_from_s=1.0).ok
    trace["velocity_ratio"] = 0.0  # of an older log: the set point of the configuration
    assert not watched(applied, trace, per_window, enabled_from_s=1.0).ok


def test_below_is_a_warning_with_its_seconds() -> None:
    seen = watched(*made(stretch(0.5, 1.01)))
    assert seen.ok
    assert seen.below_s == pytest.approx(0.5, abs=2e-3)


@pytest.mark.parametrize("bit", [GAP, STALE, LATE])
def test_a_stall_and_the_second_after_it_have_no_lower_limit(bit: int) -> None:
    applied, trace = made(stretch(0.9, 0.5))
    trace["events"][3999] |= bit
    seen = watched(applied, trace)
    assert seen.lowest == pytest.approx(1.2)
    assert seen.left_out_s == pytest.approx(1.0, abs=5e-3)


@pytest.mark.parametrize(("field", "value"), [("late_ns", 40_000_000), ("fallback", 1)])
def test_a_stall_of_the_rig_counts_as_well(field: str, value: int) -> None:
    applied, trace = made(stretch(0.9, 0.5))
    applied[field][3999] = value
    seen = watched(applied, trace)
    assert seen.below_s == 0.0
    assert seen.left_out_s == pytest.approx(1.0, abs=5e-3)


def test_the_upper_limit_holds_after_a_stall() -> None:
    """Gaps in the commands, once a second, hid each excess."""
    applied, trace = made(stretch(0.9, 3.18))
    applied["fallback"][3999] = 1
    seen = watched(applied, trace)
    assert not seen.ok
    assert seen.highest == pytest.approx(3.18)


def test_a_run_without_vibration_has_no_ratio_lines() -> None:
    applied, trace = made(np.full(100, 1.2))
    trace["mode"] = 0
    seen = watched(applied, trace)
    assert seen.ok
    assert seen.in_words() == ""
