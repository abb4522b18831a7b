"""A rotating load: the phase at the begin of each run, from the model where the breakaways are too few."""

import math

import numpy as np
import pytest

from diagnosis.fits.load_phases import starts_by_run
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.hypothesis import NOTHING
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
    values = {axis.name: axis.value(coordinate) for axis, coordinate in zip(form.coordinates, w.tolist(), strict=True)}
    assert values["frequency_Hz"] == pytest.approx(FREQUENCY_HZ, abs=0.05)  # 0.05 Hz: half a turn in ten seconds
    phases = [value for name, value in values.items() if is_phase(name)]
    assert len(phases) == len(fitter.problem.runs)
    ahead = [math.remainder(phase - PHASE_RAD, 2.0 * math.pi) for phase in phases]
    assert max(map(abs, ahead)) < math.pi / 2
    best = fitter.refit(form, deviations, w)
    assert best.chi2 < 0.5 * origin.chi2
