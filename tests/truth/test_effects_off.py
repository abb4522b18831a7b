"""An effect of no size is the nominal rig, to the last bit; one of any size within its bounds stays finite."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bridge.config import validate
from bridge.faults import Fault
from plant.config import RigConfig
from plant.effects.library import EFFECTS, checked
from plant.records import build
from tests.effects_rig import run

# parameters that leave nothing of their effect at 0
SIZES = {
    *("ratio", "lag_s", "damping_Ns_per_m", "damping_Ns2_per_m2", "rate_per_s", "gap_m", "compliance_m_per_N"),
    *("bias_N", "rate_N_per_s", "drift_N", "delay_s", "distance_m"),
}
NEVER_NOTHING = {"piezo-roll-off", "piezo-resonance"}  # a corner cannot be infinitely high
FORMS = [(name, form) for name, effect in EFFECTS.items() for form in effect.forms]
DRIVE_MPS = np.linspace(0.0, 0.02, 100)


def paper_rig(effects):
    return validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063"}, "effects": effects}, "test")


def rows(config, drive=DRIVE_MPS, frequency_Hz=2000.0):
    result = run(config, drive, None, frequency_Hz, 5e-8)
    return np.array([row for name, row in vars(result).items() if name != "t_s"])


@pytest.fixture(scope="module")
def nominal_bytes():
    return rows(paper_rig({})).tobytes()


def nothing(name, form):
    row = next(row.name for row in EFFECTS[name].forms[form].parameters if row.name in SIZES)
    return {name: {"form": form, row: 0.0}}


@pytest.mark.parametrize(("name", "form"), [row for row in FORMS if row[0] not in NEVER_NOTHING])
def test_an_effect_of_no_size_is_the_nominal_rig(name, form, nominal_bytes):
    config = paper_rig(nothing(name, form))
    assert build(config)[0][0].disturbed == 0
    assert rows(config).tobytes() == nominal_bytes


def test_all_of_them_at_once_are_as_well(nominal_bytes):
    tables = {}
    for name in EFFECTS.keys() - NEVER_NOTHING:
        tables |= nothing(name, next(iter(EFFECTS[name].forms)))
    assert rows(paper_rig(tables)).tobytes() == nominal_bytes


@pytest.mark.parametrize("name", [name for name in EFFECTS if name != "direction-dependent-friction"])
def test_an_effect_of_its_default_size_is_not(name, nominal_bytes):
    """Effects that act backwards only are left out."""
    assert rows(paper_rig({name: {}})).tobytes() != nominal_bytes


def spread(row):
    """From one end of its range to the other, evenly in its logarithm where it is all positive."""
    if row.low > 0.0 and row.high / row.low > 100.0:
        return st.floats(math.log(row.low), math.log(row.high)).map(
            lambda log: min(max(math.exp(log), row.low), row.high)
        )
    return st.floats(row.low, row.high)


def any_values(name, form):
    return st.fixed_dictionaries({row.name: spread(row) for row in EFFECTS[name].forms[form].parameters})


def finite(name, values, drive_mps, frequency_Hz):
    values = checked(name, values)
    if name == "base-compliance":
        per_kg = values["compliance_m_per_N"] * (2 * math.pi * values["frequency_Hz"]) ** 2
        if per_kg * 0.0078 > 1.0:  # the configuration refuses so light a base
            values = values | {"compliance_m_per_N": values["compliance_m_per_N"] / (per_kg * 0.0078)}
    if name == "static-friction-ageing":
        try:
            paper_rig({name: values})
        except Fault:  # the configuration refuses to take away all of the static friction
            values = values | {"rested_s": 0.0}
    drive = np.concatenate([np.full(150, drive_mps), np.full(100, -drive_mps), np.full(50, drive_mps)])
    result = rows(paper_rig({name: values}), drive, frequency_Hz)
    velocity_mps, force_N = result[7], result[5]
    assert np.all(np.isfinite(result))
    # nothing of these bounds gives the slide more than a drive that jumps at full speed does
    assert np.abs(velocity_mps).max() < 5.0
    assert np.abs(force_N).max() < 1e6


@pytest.mark.parametrize(("name", "form"), FORMS)
@settings(max_examples=12)
@given(st.data())
def test_any_size_within_the_bounds_stays_finite(name, form, data):
    values = {"form": form} | data.draw(any_values(name, form))
    finite(name, values, data.draw(st.sampled_from([5e-4, 5e-3, 0.05])), data.draw(st.sampled_from([600.0, 4000.0])))


@pytest.mark.parametrize(("name", "form"), FORMS)
def test_each_bound_stays_finite(name, form):
    for row in EFFECTS[name].forms[form].parameters:
        for value in (row.low, row.high):
            finite(name, {"form": form, row.name: value}, 0.005, 4000.0)


@pytest.mark.parametrize(
    ("name", "values"),
    [
        ("position-dependent-friction", {"ratio": 0.9, "wavelength_m": 1e-5}),
        ("normal-load-fluctuation", {"form": "random", "ratio": 0.9, "frequency_Hz": 1000.0}),
        ("coulomb-level", {"ratio": -0.9}),
        ("static-level", {"ratio": 10.0}),
    ],
)
def test_friction_that_falls_by_much_of_itself_within_a_step_stays_finite(name, values):
    """There the bristle's damper pushes: without a guard the slide was at 1e90 m/s, or not a number."""
    for drive_mps in (5e-4, 0.05):
        finite(name, values, drive_mps, 4000.0)
