"""Axes drawn from a seed."""

from bench.control.drawn import drawn_axes


def test_a_seed_draws_the_same_axes_and_another_one_others() -> None:
    first, again, other = drawn_axes(4, 12), drawn_axes(4, 12), drawn_axes(5, 12)
    assert [one.table for one in first] == [one.table for one in again]
    assert first[0].table != other[0].table
    assert len({one.name for one in first}) == 12


def test_every_axis_is_one_that_the_controller_takes_and_slips_faster_than_its_feed() -> None:
    for one in drawn_axes(6, 12):
        one.scenario()
        drive, contact = one.rig.drive, one.rig.contact
        drop_N = contact.static_force_N - contact.coulomb_force_N
        slip_mps = drop_N / (drive.stiffness_N_per_m * one.rig.slide.mass_kg) ** 0.5
        assert slip_mps > 1.4 * one.slowest_mps
        assert one.duration_s <= 120.0


def test_every_other_axis_goes_back() -> None:
    lowest = [min(v for _, v in one.rig.drive.profile) for one in drawn_axes(6, 6)]
    assert [v < 0.0 for v in lowest] == [False, True] * 3
