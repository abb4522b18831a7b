"""Rigs side by side against the plant's own kernel, form by form, and against themselves in other company."""

import math

import numpy as np
import pytest

from bridge.wire.channels import CHANNELS
from diagnosis.features.grid import SIGNALS
from diagnosis.features.segments import CommandedRun
from diagnosis.gap.measure import replicates
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.model import predict as twin
from diagnosis.model.per_run import as_in_rig_file
from diagnosis.model.predict import predict, predict_many
from diagnosis.model.rig import Roughness, Start, StartState, built, rig_config
from diagnosis.model.sensor_chain import SENSOR_EFFECTS
from plant.core import advance, advance_disturbed
from plant.effects.library import EFFECTS
from plant.four_rigs import advance_lanes
from plant.four_rigs_step import LANES, NARROW, decayed
from plant.records import TRUTH
from tests.prepared import prepared

FORMS = [(name, form) for name, effect in EFFECTS.items() if name not in SENSOR_EFFECTS for form in effect.forms]
ROUNDING = 1e-8  # of the largest value of a signal: slips make it grow, to 5e-10 here


@pytest.fixture(scope="module")
def ladder():
    evidence, runs = prepared("ladder")
    return evidence.rig, runs


@pytest.fixture(scope="module")
def tables(ladder):
    """Every form as the library tries it; a random one as it might be drawn."""
    rig, runs = ladder
    tried = {
        next(iter(trial.hypothesis.forms.items())): {
            name: as_in_rig_file(table) for name, table in trial.hypothesis.tables(trial.w).items()
        }
        for trial in reversed(trials(Problem(rig, runs)))
    }
    load = {"form": "random", "ratio": 0.03, "frequency_Hz": 4.0, "seed": 3.0}
    friction = {"form": "random", "ratio": 0.03, "wavelength_m": 3e-4, "seed": 3.0}
    tried["normal-load-fluctuation", "random"] = {"normal-load-fluctuation": load}
    tried["position-dependent-friction", "random"] = {"position-dependent-friction": friction}
    return tried


def there_and_back(seconds_a_leg: float = 0.6) -> CommandedRun:
    """Stick-slip, then under vibration, the same backwards, and at rest."""
    blocks = round(1e3 * seconds_a_leg)
    drive = np.repeat([3e-3, 3e-3, -3e-3, -3e-3, 0.0], blocks)
    frequency_Hz = np.repeat([0.0, 2000.0, 3300.0, 0.0, 0.0], blocks)
    amplitude_m = np.repeat([0.0, 2.6e-7, 1.5e-7, 0.0, 0.0], blocks)
    return CommandedRun(drive, frequency_Hz, amplitude_m, (), None)


def alone(config, commands, start):
    """A run of one rig through the plant's own kernel, block by block, without entries."""
    params, state, steps = built(config, False, commands, start)
    p = params[0]
    # separate arrays of each length: the kernels would be compiled again for a part of a longer array, in 11 s
    scratch = {
        samples: (np.empty((len(CHANNELS), samples)), np.empty((len(TRUTH), samples)))
        for samples in set(steps.tolist())
    }
    out = np.empty((len(SIGNALS), len(steps)))
    advanced = advance_disturbed if p.disturbed else advance
    p.steps_per_sample = 1
    per_block = zip(steps.tolist(), commands.drive, commands.frequency_Hz, commands.amplitude_m, strict=True)
    for block, (samples, drive, frequency_Hz, amplitude_m) in enumerate(per_block):
        p.samples_per_block, p.dt_s = samples, 1e-3 / samples
        if not p.disturbed:
            steps_of_one_length(p, state[0], first=block == 0)
        analogue, truth = scratch[samples]
        advanced(params, state, drive, frequency_Hz, amplitude_m, analogue, truth)
        out[:5, block] = analogue.mean(axis=1)
        out[5:, block] = [math.sqrt(analogue[row].var()) for row in (1, 2)]
    return dict(zip(SIGNALS, out, strict=True))


def steps_of_one_length(p, s, first):
    """The nominal kernel takes longer steps while a slide sticks, which rigs side by side do not."""
    p.steps_per_stick_sample, p.stick_dt_s = 1, p.dt_s
    for name in ("force_keep", "accel_keep", "accel_highpass_keep", "position_keep"):
        p[f"{name}_stick"] = p[name]
    s.dt_s = 0.0 if first else p.dt_s


def test_the_exponential_of_additions_and_multiplications():
    a = np.concatenate([np.linspace(0.0, 3.0, 3001), np.geomspace(1e-12, 690.0, 3001)])
    results = np.array([decayed(item) for item in a])
    np.testing.assert_allclose(results, np.expm1(-a), rtol=3e-16, atol=3e-16)


def worst(results, expected) -> float:
    return max(
        float(np.abs(one[name] - other[name]).max() / (np.abs(other[name]).max() + 1e-12))
        for one, other in zip(results, expected, strict=True)
        for name in other
    )


def rigs(rig, effects, roughness=None, count=LANES):
    """As many, each with other numbers."""
    values = [{"coulomb_force_N": rig.coulomb_force_N * (1.0 + 0.004 * number)} for number in range(count)]
    return [rig_config(rig, value, effects, roughness) for value in values]


@pytest.mark.slow
@pytest.mark.parametrize(("name", "form"), [("", ""), *FORMS])
def test_as_the_plants_kernel(ladder, tables, name, form):
    rig, _ = ladder
    configs = rigs(rig, tables[name, form] if name else {}, count=2)
    commands, start = there_and_back(), Start(0.5 * rig.coulomb_force_N, 0.0)
    results = predict_many(configs, False, commands, [start] * 2, [()] * 2)
    expected = [alone(config, commands, start) for config in configs]
    assert np.ptp(expected[0]["drive_force_N"]) > 20.0  # it slides both ways
    assert worst(results, expected) < ROUNDING


@pytest.mark.slow
def test_as_the_plants_kernel_on_a_rough_surface_and_with_a_tail(ladder):
    rig, _ = ladder
    tail = [{"coulomb_force_N": rig.coulomb_force_N * share, "stribeck_tail": 0.3} for share in (1.0, 1.004)]
    configs = rigs(rig, {}, Roughness(0.01, 2e-5, 7), count=2) + [rig_config(rig, lane, {}, None) for lane in tail]
    commands, start = there_and_back(), Start(0.5 * rig.coulomb_force_N, 0.0)
    assert (
        worst(
            predict_many(configs, False, commands, [start] * 4, [()] * 4),
            [alone(config, commands, start) for config in configs],
        )
        < ROUNDING
    )


def test_to_the_last_bit_the_same_in_any_company(ladder, tables):
    """More rigs than go side by side, each with another effect, entered where runs are entered."""
    rig, _ = ladder
    commands, start = there_and_back(0.1), Start(0.5 * rig.coulomb_force_N, 0.0)
    entries = (StartState(130, 9.0, 0.4), StartState(260, -11.0, None))
    configs = [rig_config(rig, {}, tables[key], None) for key in FORMS]
    assert len(configs) > 2 * LANES
    together = predict_many(configs, False, commands, [start] * len(configs), [entries] * len(configs))
    for config, results in zip(configs, together, strict=True):
        by_itself = predict(config, False, commands, start, entries)
        assert all(np.array_equal(results[name], by_itself[name]) for name in by_itself)


def test_to_the_last_bit_the_same_whether_four_or_eight_are_stepped_at_once(ladder, tables):
    rig, _ = ladder
    commands, start = there_and_back(0.1), Start(0.5 * rig.coulomb_force_N, 0.0)
    keys = ["frictional-lag", "static-friction-ageing", "drive-speed-ripple", "piezo-sag", "normal-load-fluctuation"]
    configs = [rig_config(rig, {}, tables[next(key for key in FORMS if key[0] == name)], None) for name in keys]
    configs += rigs(rig, {}, Roughness(0.01, 2e-5, 7), count=3)
    entries = (StartState(130, 9.0, 0.4),)
    at_once, in_halves = (
        [
            signals
            for part in parts
            for signals in predict_many(part, False, commands, [start] * len(part), [entries] * len(part))
        ]
        for parts in ([configs], [configs[:NARROW], configs[NARROW:]])
    )
    for one, other in zip(at_once, in_halves, strict=True):
        assert all(np.array_equal(one[name], other[name]) for name in other)


def test_likely_next_points_are_simulated_in_free_lanes(ladder, monkeypatch):
    rig, runs = ladder
    nuisances = Nuisances(rig)
    now, soon, *later = (nuisances.point(0.1 * number * np.ones(len(nuisances)), {}) for number in range(6))
    alone = [Problem(rig, runs[:1]).predicted(point) for point in (now, soon)]
    problem = Problem(rig, runs[:1])
    calls = []
    monkeypatch.setattr(twin, "advance_lanes", lambda *given: calls.append(advance_lanes(*given)))
    results = problem.predicted_many([now], perhaps=[soon, *later])
    assert len(calls) == 1
    again = problem.predicted(soon)
    assert len(calls) == 1
    problem.predicted(later[-1])  # there was no lane for it
    assert len(calls) == 2
    assert np.array_equal([*results, again], alone, equal_nan=True)


def test_no_bit_depends_on_the_threads(ladder):
    rig, runs = ladder
    nuisances = Nuisances(rig)
    points = [nuisances.point(0.1 * number * np.ones(len(nuisances)), {}) for number in range(3)]
    one, three = (
        [*problem.predicted_many(points), *replicates(problem, points[0], Roughness(0.003, 1.5e-4, 0), 5, 1)]
        for problem in (Problem(rig, runs, jobs) for jobs in (1, 3))
    )
    assert np.array_equal(one, three, equal_nan=True)
