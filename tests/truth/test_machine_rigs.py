"""The machines of deploy/rigs stick and slip without a controller, on the way out and on the way back where they go back."""

import math

import numpy as np
import pytest

from cockpit.run.scenario import load_scenario
from plant.simulate import held_velocity, simulate


@pytest.mark.parametrize(
    ("name", "ways", "stuck", "slips"),
    [
        # least share of the moving time in which the slide rests, and least slips a stroke
        ("ball-screw-axis", (1.0, -1.0), 0.15, 300),
        ("belt-axis", (1.0, -1.0), 0.5, 100),
        ("pneumatic-seal", (1.0, -1.0), 0.5, 10),
        ("drill-string", (1.0,), 0.3, 8),
    ],
)
def test_a_machine_sticks_and_slips(name: str, ways: tuple[float, ...], stuck: float, slips: int) -> None:
    rig = load_scenario(name, []).rig
    duration_s = rig.drive.repeat_every_s or 45.0
    result = simulate(rig, duration_s)
    blocks = np.arange(round(duration_s / rig.solver.block_s))
    drive_mps = np.repeat(held_velocity(rig)(blocks * rig.solver.block_s), rig.solver.samples_per_block)
    speed_mps = float(np.abs(drive_mps).max())
    assert (drive_mps.min() < 0.0) == (-1.0 in ways)
    for way in ways:
        moving = way * drive_mps > 0.99 * speed_mps
        slide_mps = way * result.velocity_mps
        assert (np.abs(slide_mps[moving]) < 0.1 * speed_mps).mean() > stuck
        fast = slide_mps > 1.5 * speed_mps
        assert np.count_nonzero(fast[1:] & ~fast[:-1] & moving[1:]) >= slips
        assert (way * result.drive_force_N[moving]).max() > 0.9 * rig.contact.static_force_N


def test_the_drill_string_is_its_well_in_small() -> None:
    """Well B of Aarsnes and Shor at 2500 m, from the sizes of its pipe and collars."""
    pipe_m4 = math.pi / 32.0 * (0.146529**4 - 0.123024**4)
    stiffness_Nm_per_rad = 61e9 * pipe_m4 / (2500.0 - 230.0)
    collars = [
        (48.7, 0.150473, 0.096207),
        (114.8, 0.187322, 0.098912),
        (56.7, 0.20955, 0.071438),
        (38.88, 0.24728, 0.123391),
    ]
    inertia_kgm2 = 7850.0 * sum(math.pi / 32.0 * length * (outer**4 - inner**4) for length, outer, inner in collars)
    rig = load_scenario("drill-string", []).rig
    per_s2 = rig.drive.stiffness_N_per_m / rig.slide.mass_kg
    assert per_s2 == pytest.approx(stiffness_Nm_per_rad / inertia_kgm2, rel=0.01)
    turning_rad_per_s, speed_mps = 40.0 * 2.0 * math.pi / 60.0, rig.drive.profile[0][1]
    fall_Nm, fall_N = 2e3, rig.contact.static_force_N - rig.contact.coulomb_force_N
    in_small = fall_N / (math.sqrt(rig.drive.stiffness_N_per_m * rig.slide.mass_kg) * speed_mps)
    assert in_small == pytest.approx(
        fall_Nm / (math.sqrt(stiffness_Nm_per_rad * inertia_kgm2) * turning_rad_per_s), rel=0.02
    )
