"""A mirrored profile gives the mirrored signals: in every form of every effect, in both kernels, and as sensors.

`test_side_by_side` holds four rigs at once against the plant's own kernel on a stroke and its return, form by form.
"""

import math

import numpy as np
import pytest

from bridge.wire.channels import CHANNELS
from bridge.wire.messages import sensor_block
from plant.effects.library import EFFECTS, checked
from plant.effects.waves import smooth_noise
from plant.records import TRUTH, build
from plant.sensors import digitise
from tests.effects_rig import BLOCK_S, rig, run, towed

# a stroke of 4 mm forth and one of 5 mm back, at 10 mm/s, with stops: it sticks and slips both ways
LEGS_MPS = (0.01, 0.0, -0.01, 0.0)
DRIVE = np.repeat(LEGS_MPS, (400, 50, 500, 50))
SIGNALS = (*CHANNELS, *TRUTH)
# sizes at which a form shows on this stroke; every other parameter has its default
SIZES: dict[str, dict[str, float]] = {
    "drive-backlash": {"gap_m": 3e-4},
    "drive-hardening": {"ratio": 0.2},
    "frictional-lag": {},
    "static-friction-ageing": {"rested_s": 0.01},
}
# a wave along the track reads as its mirror image backwards: sin(pi - a) = sin a, its second harmonic with the other sign
MIRRORED_WAVES = ("position-dependent-friction", "drive-speed-ripple")
FORMS = [(name, form) for name, effect in EFFECTS.items() for form in effect.forms]
# rounding of a phase, which slips make grow; 3e-12 is the worst of all forms here
ROUNDING = 1e-10


def mirrored(name: str, table: dict[str, float | str]) -> dict[str, float | str]:
    """The effect on a rig that is mounted the other way round."""
    table = dict(table)
    if name in {"force-sensor-bias", "force-sensor-drift"}:
        for key in ("bias_N", "drift_N", "rate_N_per_s"):
            if key in table:
                table[key] = -float(table[key])
    if name in MIRRORED_WAVES and table.get("form") != "time":
        for key in ("phase_rad", "other_phase_rad"):
            if key in table:
                table[key] = -float(table[key]) if table["form"] == "bumps" else math.pi - float(table[key])
        if "second_sin" in table:
            table["second_sin"] = -float(table["second_sin"])
    return table


def both(effects, other_effects, contact=None, **vibration):
    """A run, and the mirrored run of the mirrored rig."""
    pair = {"pair": "C45-C45 @ 0.063"} | (contact or {})
    starts = ({}, {})
    if vibration:  # half a period later the base goes the other way
        starts = (
            {"amplitude_m": 1e-7, "frequency_Hz": 2600.0},
            {"amplitude_m": 1e-7, "frequency_Hz": 2600.0, "phi": math.pi},
        )
    there = run(rig(effects, contact=pair), DRIVE, starts[0], **vibration)
    back = run(rig(other_effects, contact=pair), -DRIVE, starts[1], **vibration)
    return there, back


def worst(there, back) -> float:
    """Largest difference of a signal from its mirror image, over its largest value."""
    return max(
        float(np.abs(getattr(there, name) + getattr(back, name)).max() / np.abs(getattr(there, name)).max())
        for name in SIGNALS
        if np.abs(getattr(there, name)).max() > 0.0
    )


def to_the_bit(there, back) -> bool:
    return all(np.array_equal(getattr(there, name), -getattr(back, name)) for name in SIGNALS)


def slips(force_N) -> int:
    """Falls of a force's size by 0.4 N within 3 ms; a slip falls by 5.8 N in half a swing of 71 ms."""
    falls = np.abs(force_N[60:]) - np.abs(force_N[:-60]) < -0.4
    return int(np.count_nonzero(falls[1:] & ~falls[:-1]))


def test_the_ideal_rig_to_the_bit():
    there, back = both({}, {})
    assert to_the_bit(there, back)
    forth, home = there.true_drive_force_N[:8000], there.true_drive_force_N[9000:19000]
    assert slips(forth) >= 3
    assert slips(home) >= 3
    assert home.min() < -14.0  # it pushes as hard as it pulled


@pytest.mark.parametrize(
    "contact",
    [
        {"backbone": "elasto-plastic"},
        {"stribeck_tail": 0.3},
        {"viscous_damping_Ns_per_m": 20.0},
        {"static_force_N": 60.0},  # falls by more than a third within a step: the guarded kernel
    ],
)
def test_every_contact_to_the_bit(contact):
    assert to_the_bit(*both({}, {}, contact))


TO_ROUNDING = {
    *((name, form) for name, form in FORMS if name == "position-dependent-friction" and form in {"wave", "two-waves"}),
    *(("drive-speed-ripple", form) for form in ("screw", "load")),
}
NO_MIRROR = {
    ("position-dependent-friction", "random"),
    *((n, f) for n, f in FORMS if n == "direction-dependent-friction"),
}


@pytest.mark.parametrize(("name", "form"), [key for key in FORMS if key not in NO_MIRROR])
def test_every_effect(name, form):
    table = checked(name, {"form": form, **SIZES.get(name, {})})
    if "phase_rad" in table:
        table |= (
            {"phase_rad": 0.7, "second_sin": 0.2, "second_cos": 0.1} if "second_sin" in table else {"phase_rad": 0.7}
        )
    there, back = both({name: table}, {name: mirrored(name, table)})
    if (name, form) in TO_ROUNDING:
        assert worst(there, back) < ROUNDING
    else:
        assert to_the_bit(there, back)


@pytest.mark.parametrize("effect", [{}, {"piezo-sag": {"form": "load"}}, {"base-compliance": {}}])
def test_under_vibration_half_a_period_apart(effect):
    there, back = both(effect, effect, frequency_Hz=2600.0, amplitude_m=1e-7)
    assert np.abs(there.base_accel_mps2).max() > 20.0
    assert worst(there, back) < ROUNDING


def test_friction_that_depends_on_the_direction_changes_places():
    """Friction of the way forth and of the way back, exchanged."""
    there = run(rig({"direction-dependent-friction": {"form": "both", "ratio": 0.3}}), DRIVE)
    back = run(rig({"direction-dependent-friction": {"form": "both", "ratio": -0.3}}), -DRIVE)
    assert worst(there, back) < ROUNDING  # at a velocity of 0 the force of the way forth remains
    assert np.abs(there.true_drive_force_N).max() > 1.2 * np.abs(there.true_drive_force_N[9000:19000]).max()


@pytest.mark.parametrize("way", [1.0, -1.0])
def test_a_random_track_goes_on_below_0(way):
    """The same noise, of the same spread, at places that the slide reaches backwards."""
    values = {"form": "random", "ratio": 0.1, "wavelength_m": 4e-4, "seed": 5}
    result = towed({"position-dependent-friction": values}, way * 0.005, 1.0)
    noise = np.array([smooth_noise(x / 2e-4, 5.0) for x in result.true_position_m])
    coulomb_N = rig().contact.coulomb_force_N
    assert result.true_friction_force_N == pytest.approx(way * coulomb_N * (1 + 0.1 * noise), rel=2e-3)
    at = way * np.arange(0.0, 4000.0, 0.1)
    numbers = np.array([smooth_noise(speed, 7.0) for speed in at])
    assert numbers.mean() == pytest.approx(0.0, abs=0.05)
    assert numbers.var() == pytest.approx(1.0, rel=0.05)


def readings(config, analogue_N, analogue_m):
    """Sensor signals, without noise, for these forces and positions [samples]."""
    params, _ = build(config)
    samples = len(analogue_N)
    analogue = np.zeros((len(CHANNELS), samples))
    analogue[0], analogue[3], analogue[4] = analogue_N, analogue_m, analogue_m
    block = sensor_block(samples).blank()
    digitise(params[0], analogue, np.zeros_like(analogue), block[0])
    return block[0]


def test_sensors_measure_below_0_where_configured():
    two_sided = {"force_lowest_N": -50.0, "position_lowest_m": -0.05, "position_linearity": 0.0}
    force_N = np.array([-60.0, -50.0, -17.0, 0.0, 17.0, 50.0, 60.0])
    place_m = force_N * 1e-3
    block = readings(rig(sensors=two_sided), force_N, place_m)
    assert block.drive_force_N == pytest.approx(np.clip(force_N, -50.0, 50.0), abs=50.0 / 2**16)
    assert block.drive_position_m == pytest.approx(np.clip(place_m, -0.05, 0.05), abs=0.05 / 2**18)
    block = readings(rig(), force_N, place_m)
    assert block.drive_force_N.min() == 0.0
    assert block.mass_position_m.min() == 0.0


def test_the_bow_is_over_the_whole_range():
    config = rig(sensors={"position_lowest_m": -0.05, "position_linearity": 0.002, "position_resolution_m": 0.0})
    place_m = np.linspace(-0.05, 0.05, 101)
    bow_m = readings(config, np.zeros(101), place_m).mass_position_m - place_m
    assert bow_m[0] == pytest.approx(0.0, abs=1e-8)
    assert bow_m[-1] == pytest.approx(0.0, abs=1e-8)
    assert bow_m.max() == pytest.approx(0.002 * 0.1, rel=1e-3)
    assert int(np.argmax(bow_m)) == 50


def test_strokes_of_one_block_length_end_where_they_began():
    there = run(rig(), np.repeat([0.01, -0.01], 200))
    assert there.true_drive_position_m[-1] == pytest.approx(0.0, abs=1e-12)
    assert there.t_s[-1] == pytest.approx(400 * BLOCK_S)
