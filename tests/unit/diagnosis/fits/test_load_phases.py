"""A load that turns: the phase in which each run begins, from the model where the breakaways say little."""

import math

import numpy as np
import pytest

from diagnosis.fits.load_phases import starts_by_run
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.hypotheses.trials import trials
from diagnosis.model.per_run import is_phase
from tests.prepared import fitter_of, prepared

# 8 s of CPU; tests/unit/diagnosis/model/test_per_run.py has the phases of runs apart
pytestmark = [pytest.mark.slow, pytest.mark.nightly]

FREQUENCY_HZ, PHASE_RAD = 2.6, 1.2


def test_every_run_begins_in_the_phase_that_suits_it():
    load = {"form": "sine", "ratio": 0.06, "frequency_Hz": FREQUENCY_HZ, "phase_rad": PHASE_RAD}
    fitter = fitter_of(*prepared("short", {"normal-load-fluctuation": load}))
    described = np.zeros(len(fitter.nuisances))
    origin = fitter.refit(NOTHING, described, np.zeros(0))
    starts = starts_by_run(fitter, origin, trials(fitter.problem))
    form, deviations, w = starts[0]
    assert deviations is origin.deviations
    found = {axis.name: axis.value(coordinate) for axis, coordinate in zip(form.coordinates, w.tolist(), strict=True)}
    assert found["frequency_Hz"] == pytest.approx(FREQUENCY_HZ, abs=0.05)  # half a turn in ten seconds
    phases = [value for name, value in found.items() if is_phase(name)]
    assert len(phases) == len(fitter.problem.runs)
    ahead = [math.remainder(one - PHASE_RAD, 2.0 * math.pi) for one in phases]
    assert max(map(abs, ahead)) < math.pi / 2
    best = fitter.refit(form, deviations, w)
    assert best.chi2 < 0.5 * origin.chi2
