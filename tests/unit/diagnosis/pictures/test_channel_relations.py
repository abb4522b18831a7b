"""Parity residuals: at the level of the noise on a clean rig, lit by the effect that breaks the relation."""

import numpy as np
import pytest

from diagnosis.pictures.channel_relations import friction_law, parity_residuals
from diagnosis.synthetic.folder import paper_rig
from tests.prepared import prepared

LIT = {
    "drive-hardening": ({"form": "cubic", "ratio": 0.06}, "spring", "extension_m"),
    "force-sensor-delay": ({"delay_s": 1e-3}, "curvature", "acceleration_mps2"),
    "accelerometer-gain": ({"form": "mass", "ratio": 0.15}, "motion", "acceleration_mps2"),
    "piezo-roll-off": ({"corner_Hz": 4000.0}, "exciter", "frequency_Hz"),
    "drive-speed-ripple": ({"form": "screw", "ratio": 0.08, "wavelength_m": 1.1e-3}, "drive", "drive_position_m"),
    "viscous-friction": ({"damping_Ns_per_m": 20.0}, "friction", "velocity_mps"),
}


def levels(evidence, runs):
    """The largest rms of every residual."""
    by_relation = {}
    for run in runs:
        for residual in parity_residuals(evidence.rig, run):
            by_relation[residual.name] = max(by_relation.get(residual.name, 0.0), residual.rms)
    return by_relation


@pytest.fixture(scope="module")
def clean():
    return prepared("ladder")


def test_a_clean_rig_leaves_its_noise(clean):
    by_relation = levels(*clean)
    assert set(by_relation) == {"spring", "curvature", "motion", "exciter", "drive", "friction"}
    assert all(0.02 < level < 2.0 for level in by_relation.values()), by_relation


@pytest.mark.slow
@pytest.mark.parametrize(  # tests/unit/diagnosis/relations has the relations of the others
    "effect", [pytest.param(one, marks=[pytest.mark.nightly] * (place > 1)) for place, one in enumerate(LIT)]
)
def test_an_effect_lights_its_relation(effect, clean):
    numbers, name, variable = LIT[effect]
    evidence, runs = prepared("ladder", {effect: numbers})
    by_relation = levels(evidence, runs)
    assert by_relation[name] > 2.0
    assert by_relation[name] > 1.8 * levels(*clean)[name]
    residual = next(
        residual for run in runs for residual in parity_residuals(evidence.rig, run) if residual.name == name
    )
    assert len(residual.over[variable]) == len(residual.values)


def test_a_missing_channel_takes_its_residuals_along(clean):
    evidence, runs = clean
    without = {name: values for name, values in runs[0].signals.items() if name != "mass_position_m"}
    names = [residual.name for residual in parity_residuals(evidence.rig, runs[0]._replace(signals=without))]
    assert names == ["curvature", "drive", "friction"]


def test_a_force_drive_has_its_friction():
    evidence, runs = prepared("force")
    assert levels(evidence, runs).keys() == {"friction"}
    assert levels(evidence, runs)["friction"] < 3.0
    evidence, runs = prepared("force", {"viscous-friction": {"damping_Ns_per_m": 60.0}})
    assert levels(evidence, runs)["friction"] > 6.0


def test_an_axis_with_an_accelerometer_alone_has_no_relation():
    evidence, runs = prepared("force")
    signals = {"drive_force_N": runs[0].signals["drive_force_N"]}
    signals["mass_accel_mps2"] = runs[0].commands.motion.accel_mps2
    assert parity_residuals(evidence.rig, runs[0]._replace(signals=signals)) == ()


def test_the_friction_law_is_the_steady_one(clean):
    rig = clean[0].rig
    fast = np.array([-0.1, 0.1])
    assert friction_law(rig, fast) == pytest.approx(paper_rig().contact.coulomb_force_N * np.sign(fast))
    assert friction_law(rig, np.array([1e-9]))[0] == pytest.approx(rig.static_force_N)


@pytest.mark.parametrize("place_m", [0.0, 0.0123])
def test_a_drive_that_is_held_moves_evenly(clean, place_m):
    evidence, runs = clean
    held = np.full_like(runs[0].signals["drive_position_m"], place_m)
    pieces = runs[0].noise.pieces | {"drive_position_m": np.zeros_like(runs[0].noise.pieces["drive_position_m"])}
    commands = runs[0].commands._replace(drive=np.zeros_like(held))
    run = runs[0]._replace(
        signals=runs[0].signals | {"drive_position_m": held},
        noise=runs[0].noise._replace(pieces=pieces),
        commands=commands,
    )
    (drive,) = (residual for residual in parity_residuals(evidence.rig, run) if residual.name == "drive")
    assert drive.rms < 1e-3
