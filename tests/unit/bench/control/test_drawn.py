"""Axes drawn from a seed."""

from bench.control.drawn import drawn_axes


def test_a_seed_draws_the_same_axes_and_another_one_others() -> None:
    first, again, other = drawn_axes(4, 12), drawn_axes(4, 12), drawn_axes(5, 12)
    assert [axis.table for axis in first] == [axis.table for axis in again]
    assert first[0].table != other[0].table
    assert len({axis.name for axis in first}) == 12


def test_every_drawn_axis_is_accepted_and_slips_faster_than_its_feed() -> None:
    for axis in drawn_axes(6, 12):
        axis.scenario()
        drive, contact = axis.rig.drive, axis.rig.contact
        drop_N = contact.static_force_N - contact.coulomb_force_N
        slip_mps = drop_N / (drive.stiffness_N_per_m * axis.rig.slide.mass_kg) ** 0.5
        assert slip_mps > 1.4 * axis.slowest_mps
        assert axis.duration_s <= 120.0


def test_every_other_axis_goes_back() -> None:
    lowest = [min(v for _, v in axis.rig.drive.profile) for axis in drawn_axes(6, 6)]
    assert [v < 0.0 for v in lowest] == [False, True] * 3


def test_half_of_the_axes_give_the_controller_no_k_d_and_their_names_show_it() -> None:
    axes = drawn_axes(6, 8)
    given = [axis.scenario().controller.model_fields_set >= {"drive_stiffness_N_per_m"} for axis in axes]
    assert given == [True, True, False, False] * 2
    assert [axis.name.endswith("-without-k_d") for axis in axes] == [not k_d for k_d in given]
