"""A compliant screw is separated from a lead error: without load a compliant screw runs evenly."""

import math

import numpy as np
import pytest

from diagnosis.hypotheses.catalogue import trials
from diagnosis.synthetic.runs import RunPlan
from tests.made_protocols import PROTOCOLS
from tests.prepared import fitter_of, prepared

EFFECT, RATIO, WAVELENGTH_M = "drive-speed-ripple", 0.2, 1.1e-3
# to and fro: the force goes through 0, and there the two differ most
TO_AND_FRO = (RunPlan(((0.0, 0.002), (1.5, 0.002), (1.55, -0.002)), duration_s=4.0),)


@pytest.fixture(scope="module", params=["load", "screw"])
def fitted(request):
    """The form that is there, and a refit of each form from the found wave that is nearest."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(PROTOCOLS, "to-and-fro", TO_AND_FRO)
        ripple = {"form": request.param, "ratio": RATIO, "wavelength_m": WAVELENGTH_M}
        fitter = fitter_of(*prepared("to-and-fro", {EFFECT: ripple}))
    described = np.zeros(len(fitter.nuisances))

    def off(trial):
        pitch = next(axis for axis in trial.hypothesis.coordinates if axis.name == "wavelength_m")
        return abs(math.log(pitch.scale / WAVELENGTH_M))

    fits = {}
    for form in ("load", "screw"):
        nearest = min((trial for trial in trials(fitter.problem) if trial.hypothesis.forms == {EFFECT: form}), key=off)
        fits[form] = fitter.refit(nearest.hypothesis, described, nearest.w)
    return request.param, fits


@pytest.mark.slow
def test_the_form_that_is_there_fits_best(fitted):
    present, fits = fitted
    other = "screw" if present == "load" else "load"
    assert fits[present].chi2 < 0.8 * fits[other].chi2


def test_its_numbers_come_back(fitted):
    present, fits = fitted
    table = fits[present].hypothesis.tables(fits[present].w)[EFFECT]
    assert table["ratio"] == pytest.approx(RATIO, rel=0.05)
    assert table["wavelength_m"] == pytest.approx(WAVELENGTH_M, rel=0.01)
