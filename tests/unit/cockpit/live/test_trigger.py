"""The scope: every sample from before to after a slip, once a slip."""

import numpy as np
import pytest

from cockpit.live.trigger import AFTER_S, BEFORE_S, BY_HAND, BY_SLIP
from cockpit.live.view import View
from tests.unit.cockpit.live.made import SAMPLES, Rig

BLOCKS = round((BEFORE_S + AFTER_S) * 1e3)


@pytest.fixture
def rig() -> Rig:
    return Rig()


@pytest.fixture
def view(rig: Rig) -> View:
    return View(rig, "tcp/127.0.0.1:7447", rig.clock)


def go_on(rig: Rig, view: View, blocks: range, slips_from: dict[int, int], force=lambda number: 1.0 * number):
    """Blocks in steps of 50, as a server takes them; every capture on the way."""
    found, slips = [], 0
    for number in blocks:
        slips = slips_from.get(number, slips)
        rig.block(number, force(number))
        rig.answer(number, slips)
        if number % 50 == 49:
            capture = view.step().capture
            found += [capture] if capture is not None else []
    return found


def test_a_slip_is_caught_with_what_was_before_and_after(rig: Rig, view: View) -> None:
    found = go_on(rig, view, range(1000), {400: 1})
    assert len(found) == 1
    capture = found[0]
    assert (capture.cause, capture.number, capture.missing) == (BY_SLIP, 1, 0)
    assert capture.t_s == pytest.approx(0.401)
    assert capture.samples.shape == (5, BLOCKS * SAMPLES)
    force = capture.samples[0].reshape(BLOCKS, SAMPLES)[:, 0]
    np.testing.assert_array_equal(force, np.arange(301, 501))  # 100 blocks up to the slip, 100 after it
    # the sample of the slip's block end is at zero of the capture
    assert capture.before_s == pytest.approx(0.1 - capture.sample_s)


def test_slips_that_follow_at_once_are_one_capture(rig: Rig, view: View) -> None:
    found = go_on(rig, view, range(2000), {400: 1, 450: 2, 700: 3, 1300: 4})
    assert [round(one.t_s, 3) for one in found] == [0.401, 1.301]


def test_slips_of_before_this_server_listened_are_no_trigger(rig: Rig, view: View) -> None:
    assert go_on(rig, view, range(600), {0: 7}) == []


def test_a_person_may_take_one(rig: Rig, view: View) -> None:
    go_on(rig, view, range(300), {})
    view.take_now()
    found = go_on(rig, view, range(300, 600), {})
    assert [(one.cause, round(one.t_s, 3)) for one in found] == [(BY_HAND, 0.3)]


def test_a_lost_block_is_a_hole_in_it(rig: Rig, view: View) -> None:
    go_on(rig, view, range(390), {})
    found = go_on(rig, view, range(395, 1000), {400: 1})
    assert found[0].missing == 5
    force = found[0].samples[0].reshape(BLOCKS, SAMPLES)[:, 0]
    assert np.isnan(force[89:94]).all()
    assert np.isfinite(np.delete(force, slice(89, 94))).all()
