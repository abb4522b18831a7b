"""Residuals: small on a clean rig, lit by the effect that breaks the relation."""

import numpy as np
import pytest

from diagnosis.pictures.choice import SHOWN
from diagnosis.pictures.residuals import residual_of
from tests.prepared import prepared

LIT = {
    "drive-hardening": ({"form": "cubic", "ratio": 0.06}, "spring", "extension_m"),
    "force-sensor-delay": ({"delay_s": 1e-3}, "curvature", "acceleration_mps2"),
    "accelerometer-gain": ({"form": "mass", "ratio": 0.15}, "motion", "acceleration_mps2"),
    "piezo-roll-off": ({"corner_Hz": 4000.0}, "exciter", "frequency_Hz"),
    "drive-speed-ripple": ({"form": "screw", "ratio": 0.08, "wavelength_m": 1.1e-3}, "drive", "drive_position_m"),
    "viscous-friction": ({"damping_Ns_per_m": 20.0}, "friction", "velocity_mps"),
}


def sizes(evidence, runs):
    """The largest rms of every residual."""
    seen = {}
    for name in SHOWN:
        residuals = [residual_of(name, evidence.rig, run) for run in runs]
        values = [residual.values for residual in residuals if residual is not None and len(residual.values) > 1]
        if values:
            seen[name] = max(float(np.sqrt(np.mean(value**2))) for value in values)
    return seen


@pytest.fixture(scope="module")
def clean():
    return prepared("ladder")


@pytest.mark.slow
def test_a_clean_rig_has_small_residuals(clean):
    evidence, _ = clean
    seen, rig = sizes(*clean), evidence.rig
    assert seen.keys() == SHOWN.keys()
    assert seen["spring"] < 0.01 * rig.static_force_N
    assert seen["friction"] < 0.05 * rig.coulomb_force_N
    assert seen["exciter"] < 0.05
    assert seen["drive"] < 1e-5


@pytest.mark.slow
@pytest.mark.parametrize(  # tests/unit/diagnosis/relations has the relations of the others
    "effect", [pytest.param(one, marks=[pytest.mark.nightly] * (place > 1)) for place, one in enumerate(LIT)]
)
def test_an_effect_lights_its_residual(effect, clean):
    numbers, name, variable = LIT[effect]
    evidence, runs = prepared("ladder", {effect: numbers})
    assert sizes(evidence, runs)[name] > 1.8 * sizes(*clean)[name]
    for run in runs:
        residual = residual_of(name, evidence.rig, run)
        assert residual is None or len(residual.over[variable]) == len(residual.values)


def test_a_missing_channel_takes_its_residuals_along(clean):
    evidence, runs = clean
    without = {name: values for name, values in runs[0].signals.items() if name != "mass_position_m"}
    names = sizes(evidence, [runs[0]._replace(signals=without)]).keys()
    assert names == {"breakaway", "curvature", "drive", "friction"}


def test_a_force_drive_has_its_friction():
    evidence, runs = prepared("force")
    before = sizes(evidence, runs)
    assert before.keys() == {"friction"}
    evidence, runs = prepared("force", {"viscous-friction": {"damping_Ns_per_m": 60.0}})
    assert sizes(evidence, runs)["friction"] > 2.0 * before["friction"]


def test_an_axis_with_an_accelerometer_alone_has_no_residual():
    evidence, runs = prepared("force")
    signals = {"drive_force_N": runs[0].signals["drive_force_N"]}
    signals["mass_accel_mps2"] = runs[0].commands.motion.accel_mps2
    assert sizes(evidence, [runs[0]._replace(signals=signals)]) == {}


@pytest.mark.parametrize("place_m", [0.0, 0.0123])
def test_a_drive_that_is_held_moves_evenly(clean, place_m):
    evidence, runs = clean
    held = np.full_like(runs[0].signals["drive_position_m"], place_m)
    run = runs[0]._replace(signals=runs[0].signals | {"drive_position_m": held})
    assert np.abs(residual_of("drive", evidence.rig, run).values).max() < 1e-9
