"""The scope: every sample from before to after a slip, once a slip."""

import numpy as np
import pytest

from cockpit.live.trigger import AFTER_S, BEFORE_S, BY_HAND, BY_SLIP
from cockpit.live.view import View
from tests.unit.cockpit.live.made import SAMPLES, Rig

BLOCKS = round((BEFORE_S + AFTER_S) * 1e3)


def go_on(rig: Rig, view: View, blocks: range, slips_from: dict[int, int], force=lambda number: 1.0 * number):
    """Blocks in steps of 50, as a server takes them; every capture on the way."""
    slips_caught, slips = [], 0
    for number in blocks:
        slips = slips_from.get(number, slips)
        rig.block(number, force(number))
        rig.answer(number, slips)
        if number % 50 == 49:
            capture = view.step().capture
            slips_caught += [capture] if capture is not None else []
    return slips_caught


def test_a_slip_is_caught_with_the_time_before_and_after(rig: Rig, view: View) -> None:
    slips_caught = go_on(rig, view, range(1000), {400: 1})
    assert len(slips_caught) == 1
    capture = slips_caught[0]
    assert (capture.cause, capture.number, capture.missing) == (BY_SLIP, 1, 0)
    assert capture.t_s == pytest.approx(0.401)
    assert capture.samples.shape == (5, BLOCKS * SAMPLES)
    force = capture.samples[0].reshape(BLOCKS, SAMPLES)[:, 0]
    np.testing.assert_array_equal(force, np.arange(301, 501))  # 100 blocks up to the slip, 100 after it
    # the sample of the slip's block end is at zero of the capture
    assert capture.before_s == pytest.approx(0.1 - capture.sample_s)


def test_slips_that_follow_at_once_are_one_capture(rig: Rig, view: View) -> None:
    slips_caught = go_on(rig, view, range(2000), {400: 1, 450: 2, 700: 3, 1300: 4})
    assert [round(one.t_s, 3) for one in slips_caught] == [0.401, 1.301]


def test_slips_before_the_server_listened_do_not_trigger(rig: Rig, view: View) -> None:
    assert go_on(rig, view, range(600), {0: 7}) == []


def test_an_operator_may_trigger_by_hand(rig: Rig, view: View) -> None:
    go_on(rig, view, range(300), {})
    view.take_now()
    slips_caught = go_on(rig, view, range(300, 600), {})
    assert [(one.cause, round(one.t_s, 3)) for one in slips_caught] == [(BY_HAND, 0.3)]


def test_a_lost_block_is_a_hole_in_it(rig: Rig, view: View) -> None:
    go_on(rig, view, range(390), {})
    slips_caught = go_on(rig, view, range(395, 1000), {400: 1})
    assert slips_caught[0].missing == 5
    force = slips_caught[0].samples[0].reshape(BLOCKS, SAMPLES)[:, 0]
    assert np.isnan(force[89:94]).all()
    assert np.isfinite(np.delete(force, slice(89, 94))).all()
