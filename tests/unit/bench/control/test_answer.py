"""Announcements, false claims and sums over a run, of made motions and traces."""

import numpy as np
import pytest

from bench.control.answer import end_stroke
from bridge.wire.stickslip_pb2 import EXCITE, HELD, PROBE, SMOOTH, STICK, STICK_SEEN, WATCH
from tests.unit.bench.control.made import along, at_speed, judged, times
from tests.unit.bench.control.test_motion import stuck_from


def states(blocks: int, begin: int, end: int) -> np.ndarray:
    """STICK from one block to another, else SMOOTH."""
    numbers = np.arange(blocks)
    return np.where((numbers >= begin) & (numbers < end), STICK, SMOOTH)


def test_an_announced_stick() -> None:
    seen = judged(*stuck_from(0.5, 1.2), state=states(2000, 519, 1200))
    assert seen.sticks[0, 4] == pytest.approx(0.520)
    assert seen.state.first_s == pytest.approx(0.520)
    assert len(seen.claims) == 0


def test_a_stick_under_excitation_needs_no_announcement() -> None:
    seen = judged(*stuck_from(0.5, 1.2), v_a_mps=6e-4, mode=EXCITE, state=SMOOTH, reason=HELD)
    assert seen.sticks[0, 5] == 1.0


def test_an_announcement_after_the_stick_does_not_count() -> None:
    seen = judged(*stuck_from(0.5, 1.2), state=states(2000, 1300, 1400))
    assert seen.sticks[0, 4] == -1.0


@pytest.mark.parametrize("drive_mps", [5e-4, 0.0])
def test_a_claim_in_smooth_motion_or_at_rest_is_false(drive_mps: float) -> None:
    place_m = at_speed(2.0, drive_mps)
    seen = judged(place_m, place_m, state=states(2000, 1000, 1010))
    np.testing.assert_allclose(seen.claims[:, 0], [1.001])


def test_a_claim_at_a_drive_that_creeps_to_its_turn_is_not_false() -> None:
    """A hundredth of the slowest feed counts as rest in the sums, but its slide may stick."""
    drive_m = along(np.where(times(2.0) < 1.0, 5e-4, 5e-6))
    slide_m = along(np.where(times(2.0) < 1.0, 5e-4, 0.0))
    assert len(judged(slide_m, drive_m, state=states(2000, 1200, 1210)).claims) == 0


def test_a_claim_while_vibrating_or_probing_is_not_counted() -> None:
    place_m, claim = at_speed(2.0), states(2000, 1000, 1010)
    assert len(judged(place_m, place_m, state=claim, v_a_mps=6e-4).claims) == 0
    assert len(judged(place_m, place_m, state=claim, mode=PROBE).claims) == 0
    assert len(judged(place_m, place_m, state=claim, mode=WATCH).claims) == 1


def test_exciting_for_a_stick_without_a_stick_is_a_false_claim() -> None:
    mode = np.where(np.arange(2000) >= 1000, EXCITE, WATCH)
    v_a = np.where(np.arange(2000) >= 1002, 6e-4, 0.0)
    place_m = at_speed(2.0)
    assert len(judged(place_m, place_m, v_a_mps=v_a, mode=mode, reason=STICK_SEEN, state=SMOOTH).claims) == 1
    assert len(judged(place_m, place_m, v_a_mps=v_a, mode=mode, reason=HELD, state=SMOOTH).claims) == 0


def test_v_a_below_v_d_is_counted_once_it_can_have_come_up() -> None:
    place_m = at_speed(2.0)
    weak = judged(place_m, place_m, v_a_mps=4e-4, gain=16336.0, mode=EXCITE, state=SMOOTH)
    # 150 ms and 12 loop delays of 2 blocks after the first start
    assert weak.state.covered == weak.state.uncovered == pytest.approx(2000 - 174, abs=3)
    strong = judged(place_m, place_m, v_a_mps=6e-4, gain=16336.0, mode=EXCITE, state=SMOOTH)
    assert (strong.state.covered, strong.state.uncovered) == (weak.state.covered, 0.0)


def test_v_a_that_the_stroke_cannot_reach_is_not_asked_for() -> None:
    place_m = at_speed(2.0)
    assert judged(place_m, place_m, v_a_mps=4e-4, gain=1000.0, mode=EXCITE, state=SMOOTH).state.covered == 0.0


def test_v_a_above_the_wanted_is_timed_as_the_slew_lets_it_fall() -> None:
    place_m, numbers = at_speed(2.0), np.arange(2000)
    wanted = np.where(numbers < 1000, 1e-3, 2e-4)
    fallen = np.maximum(1e-3 - np.maximum(numbers - 1001, 0) * 16336.0 * 1e-9, 2e-4)  # 1 um/s
    kept = judged(place_m, place_m, v_a_mps=fallen, gain=16336.0, wanted_velocity_mps=wanted)
    assert kept.state.above_s == 0.0
    stays = np.where(numbers < 1100, 1e-3, 2e-4)
    late = judged(place_m, place_m, v_a_mps=stays, gain=16336.0, wanted_velocity_mps=wanted)
    # 1.3 times the wanted is reached after 14 ms of the fall
    assert late.state.above_s == pytest.approx(0.1 - 0.017, abs=3e-3)
    assert late.state.above_at_s == pytest.approx(1.016, abs=3e-3)


def test_energies_are_sums_over_the_moving_time() -> None:
    drive_m = np.concatenate([at_speed(12.0), np.full(len(times(4.0)), 6e-3)])
    seen = judged(drive_m, drive_m, v_a_mps=6e-4, mode=EXCITE, state=SMOOTH)
    assert seen.state.energy == pytest.approx(12.0 * 6e-4**2, rel=2e-3)
    assert seen.state.drive_energy == pytest.approx(12.0 * 5e-4**2, rel=2e-3)
    assert seen.state.settled_s == pytest.approx(2.0, abs=0.03)  # from 10 s after the first announcement
    assert seen.state.excited_s == pytest.approx(12.0, abs=0.03)


def test_quadrant_error_and_stick_at_a_change_of_sign() -> None:
    """The drive turns at 2 s; the slide rests for another 0.3 s, catches up to 40 um and then follows 30 um behind."""
    t_s = times(4.0)
    drive_m = np.where(t_s < 2.0, t_s, 4.0 - t_s) * 1e-3
    behind_m = np.where(t_s < 2.0, 3e-5, -3e-5)
    stands = (t_s >= 2.0) & (t_s < 2.3)
    # from 0.27 to 0.04 mm behind within 20 ms, then in 100 ms to 0.03 mm
    behind_m = np.where(t_s >= 2.3, -np.interp(t_s, [2.3, 2.32, 2.42], [2.7e-4, 4e-5, 3e-5]), behind_m)
    slide_m = np.where(stands, 2e-3 - 3e-5, drive_m - behind_m)
    seen = judged(slide_m, drive_m, slowest_mps=1e-3)
    end_stroke(seen.state)
    assert seen.state.turns == 1
    assert seen.state.turn_stick_s == pytest.approx(0.3, abs=3e-3)
    # the mean from the end of the stick on: 20 ms of 155 um, 100 ms of 35 um, 1.58 s of 30 um
    mean_m = (0.02 * 1.55e-4 + 0.1 * 3.5e-5 + 1.58 * 3e-5) / 1.7
    assert seen.state.quadrant_m == pytest.approx(2.7e-4 - mean_m, rel=0.02)


def test_a_drive_that_never_turns_has_no_quadrant_error() -> None:
    seen = judged(at_speed(1.0), at_speed(1.0))
    end_stroke(seen.state)
    assert (seen.state.turns, seen.state.quadrant_m, seen.state.turn_stick_s) == (0.0, 0.0, 0.0)
