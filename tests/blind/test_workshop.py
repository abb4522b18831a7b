"""The workshop's rigs stick and slip, its effects show, and its evidence is sound, repeatable and gives nothing away."""

import json
import pickle
import tomllib
from pathlib import Path

import jsonschema
import numpy as np
import pyarrow.parquet as pq
import pytest

from plant.effects.library import EFFECTS
from tests.blind.generators import Plan, generator
from tests.blind.workshop.campaigns import Run, draw_campaign
from tests.blind.workshop.measure import measure
from tests.blind.workshop.outside import OUTSIDE
from tests.blind.workshop.rigs import KINDS, LAWS, Rig, draw_rig
from tests.blind.workshop.sizes import SIZES, Drawn, drawn

WORKSHOP = generator("workshop")
SIGNALS = ("drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m")
SCHEMA = Path(__file__).parents[2] / "deploy/schemas/evidence-1.json"
SHORT = 8  # the seed of a campaign of few runs on a rig that is fast to simulate
VARIANTS = [
    pytest.param(
        *(name, form, sizes),
        id=f"{name}-{form or 'one'}-{number}",
        marks=[pytest.mark.nightly] * (number > 0),  # the first form covers it
    )
    for name, variants in SIZES.items()
    for number, (form, sizes) in enumerate(variants)
]


def _rig(kind: str = "friction tester", law: str | None = "lugre", smooth: bool = True) -> Rig:
    for seed in range(100):
        rig = draw_rig(np.random.default_rng(seed), law, 1.0, smooth)
        if rig.kind.name == kind:
            return rig
    raise AssertionError(f"no {kind} in 100 rigs")


def _busy(rig: Rig) -> Run:
    """Slips, turns, slips the other way and vibrates within 3.5 s."""
    speed, height_m = rig.kind.speeds_mps[2], rig.kind.amplitude_m
    drive = ((0.0, speed), (1.2, speed), (1.23, -speed))
    return Run(drive, ((2.0, 3.0, 3600.0, height_m), (3.0, 3.45, 2000.0, height_m)), 3.5, False, 30.0, 0.01, 0.5, 1.0)


def _change(rig: Rig, run: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> float:
    """Largest rms difference of a signal, in drops of the force, lengths of a slip, or rms accelerations."""
    drop_N = rig.true["static_force_N"] - rig.true["coulomb_force_N"]
    scales = {"drive_force_N": drop_N, "mass_position_m": rig.units["slip"], "drive_position_m": rig.units["slip"]}
    return max(float(np.sqrt(np.mean((run[k] - other[k]) ** 2)) / scales.get(k, other[k].std())) for k in SIGNALS)


@pytest.fixture(scope="module")
def busy():
    rig = _rig()
    return measure(rig, _busy(rig), (), [1, 2])


@pytest.mark.parametrize("law", [LAWS[0], *(pytest.param(law, marks=pytest.mark.nightly) for law in LAWS[1:])])
@pytest.mark.parametrize("kind", [kind.name for kind in KINDS])
def test_a_rig_without_effects_sticks_and_slips_at_all_its_speeds(kind, law):
    rig = _rig(kind, law, smooth=False)
    drop_N = rig.true["static_force_N"] - rig.true["coulomb_force_N"]
    for speed in rig.kind.speeds_mps:
        columns = measure(rig, Run(((0.0, speed),), (), 4.0, False, 0.0, 0.01, 0.5, 1.0), (), [1, 2])
        force_N = columns["drive_force_N"][len(columns["t_s"]) // 3 :]
        above = force_N[np.abs(force_N - force_N.mean()) > 0.4 * drop_N] > force_N.mean()
        assert np.ptp(force_N) > 1.5 * drop_N
        assert np.count_nonzero(above[:-1] & ~above[1:]) >= 2


def test_vibration_stops_the_slips():
    rig = _rig()
    speed = rig.kind.speeds_mps[0]
    run = Run(((0.0, speed),), ((3.0, 5.0, 4000.0, rig.kind.amplitude_m),), 5.0, False, 0.0, 0.01, 0.5, 1.0)
    columns = measure(rig, run, (), [1, 2])
    alone, vibrated = (
        columns["drive_force_N"][(columns["t_s"] > a) & (columns["t_s"] < b)] for a, b in ((1, 3), (4, 4.9))
    )
    assert np.ptp(vibrated) < 0.3 * np.ptp(alone)


def test_the_library_is_the_plant_s_and_the_outside_none_of_it():
    assert {*WORKSHOP.library} == {*EFFECTS}
    assert {(name, form) for name, variants in SIZES.items() for form, _ in variants} == {
        (name, form) for name, effect in EFFECTS.items() for form in effect.forms
    }
    assert len(WORKSHOP.outside) >= 6
    assert not {*WORKSHOP.outside} & {*EFFECTS}


@pytest.mark.parametrize(("name", "form", "sizes"), VARIANTS)
def test_an_effect_of_the_library_shows_at_1(name, form, sizes, busy):
    rig = _rig()
    full = measure(rig, _busy(rig), (drawn(np.random.default_rng(3), name, form, sizes),), [1, 2])
    assert all(np.isfinite(full[signal]).all() for signal in SIGNALS)
    assert _change(rig, full, busy) > 0.01


@pytest.mark.parametrize("name", OUTSIDE)
def test_an_outside_effect_is_clearly_visible_at_1(name, busy):
    rig = _rig()
    full = measure(rig, _busy(rig), (WORKSHOP.draw(np.random.default_rng(3), name),), [1, 2])
    assert all(np.isfinite(full[signal]).all() for signal in SIGNALS)
    assert _change(rig, full, busy) > 0.1


@pytest.mark.nightly  # strength 0 covers it
@pytest.mark.parametrize("name", [*SIZES, *OUTSIDE])
def test_an_effect_fades_towards_0(name, busy):
    rig = _rig()
    effect = WORKSHOP.draw(np.random.default_rng(3), name)
    full, faint = (measure(rig, _busy(rig), (effect.scaled(s),), [1, 2]) for s in (1.0, 0.001))
    assert _change(rig, faint, busy) < 0.3 * _change(rig, full, busy)


def test_strength_0_has_no_effect(busy):
    rig = _rig()
    names = (*WORKSHOP.library, *WORKSHOP.outside)
    absent = tuple(WORKSHOP.draw(np.random.default_rng(2), name).scaled(0.0) for name in names)
    still = measure(rig, _busy(rig), absent, [1, 2])
    assert all(np.array_equal(still[name], busy[name]) for name in busy)


@pytest.mark.parametrize("name", ["cable-chain", "loose-payload", "wiper-seal"])
def test_a_force_on_the_slide_leaves_the_spring_s_law(name):
    """The sensor reads stiffness times extension, whatever else pulls at the slide."""
    rig = _rig()
    rig = rig._replace(
        sensors=rig.sensors | {"force_bandwidth_Hz": 5e3, "position_bandwidth_Hz": 5e3, "force_late_s": 0.0}
    )
    effect = WORKSHOP.draw(np.random.default_rng(3), name)
    columns = measure(rig, _busy(rig), (effect,), [1, 2])
    law_N = rig.true["drive_stiffness_N_per_m"] * (columns["drive_position_m"] - columns["mass_position_m"])
    assert np.abs(columns["drive_force_N"] - law_N).max() < 0.02 * rig.true["static_force_N"]


def test_a_chain_pulls_by_its_stiffness():
    rig, run = _rig(), Run(((0.0, 0.0),), (), 1.0, False, 0.0, 0.01, 0.2, 1.0)
    effect = WORKSHOP.draw(np.random.default_rng(3), "cable-chain")
    chain = effect.values(rig.units)
    start_m = chain["rest_m"] + 2.0 * rig.true["static_force_N"] / chain["stiffness"]
    columns = measure(rig, run._replace(start_m=start_m), (effect,), [1, 2])
    settled = slice(len(columns["t_s"]) // 2, None)
    # it slips towards the chain's rest until friction holds it
    rest_N = columns["drive_force_N"][settled].mean() - chain["stiffness"] * (
        columns["mass_position_m"][settled].mean() - chain["rest_m"]
    )
    assert columns["mass_position_m"][-1] < start_m - 1e-4
    assert abs(rest_N) < 1.01 * rig.true["static_force_N"]


def test_numbers_are_drawn_within_their_tolerances():
    for seed in range(50):
        rig = draw_rig(np.random.default_rng(seed), None, 1.0, smooth=False)
        off = [np.log(rig.true[key] / rig.described[key]) / rig.kind.numbers[key][1] for key in rig.described]
        assert np.abs(off).max() <= 2.5 + 1e-9
    exact = draw_rig(np.random.default_rng(1), None, 0.0, smooth=True)
    assert exact.true == pytest.approx(exact.described, rel=1e-12)


def test_a_campaign_has_three_to_five_runs_with_a_turn_a_vibration_and_one_or_two_held_out():
    for seed in range(50):
        runs = draw_campaign(KINDS[seed % len(KINDS)], np.random.default_rng(seed))
        fitted = [run for run in runs if not run.held_out]
        assert 3 <= len(runs) <= 5
        assert 1 <= len(runs) - len(fitted) <= 2
        assert any(run.vibration for run in fitted)
        assert any(min(mps for _, mps in run.drive) < 0.0 < max(mps for _, mps in run.drive) for run in fitted)
        assert all(6.0 <= run.duration_s <= 15.0 for run in runs)


# the folder


@pytest.fixture(scope="module")
def folders(tmp_path_factory):
    """Twice the same plan and seed, and the same without its effect."""
    folder = tmp_path_factory.mktemp("workshop")
    effect = WORKSHOP.draw(np.random.default_rng(1), "drive-stiffness")
    for name, effects in (("one", (effect,)), ("other", (effect,)), ("without", ())):
        WORKSHOP.make(folder / name, Plan(effects=effects, leave_out=("drive_position_m",)), SHORT)
    return folder


def test_the_same_plan_and_seed_give_the_same_bytes(folders):
    names = sorted(path.name for path in (folders / "one").iterdir())
    assert all((folders / "one" / name).read_bytes() == (folders / "other" / name).read_bytes() for name in names)
    assert (folders / "one/run-01.parquet").read_bytes() != (folders / "without/run-01.parquet").read_bytes()


def test_a_folder_does_not_reveal_its_effect(folders):
    manifests = [(folders / side / "manifest.toml").read_bytes() for side in ("one", "without")]
    assert manifests[0] == manifests[1]
    for path in (folders / "one").glob("*.parquet"):
        schemas = [pq.read_schema(p) for p in (path, folders / "without" / path.name)]
        assert schemas[0].equals(schemas[1], check_metadata=True)
        assert "drive_position_m" not in schemas[0].names
        assert pq.read_metadata(path).num_rows == pq.read_metadata(folders / "without" / path.name).num_rows


def test_the_manifest_keeps_the_schema_of_evidence(folders):
    manifest = tomllib.loads((folders / "one/manifest.toml").read_text(encoding="utf-8"))
    jsonschema.validate(manifest, json.loads(SCHEMA.read_text(encoding="utf-8")))
    assert {run["file"] for run in manifest["run"]} == {path.name for path in (folders / "one").glob("*.parquet")}


def test_a_plan_that_no_bench_can_keep_is_refused(tmp_path):
    with pytest.raises(ValueError, match="leave_out"):
        WORKSHOP.make(tmp_path, Plan(leave_out=("t_s",)), SHORT)
    with pytest.raises(ValueError, match="backbone"):
        WORKSHOP.make(tmp_path, Plan(backbone="none"), SHORT)


def test_an_effect_travels_to_workers_and_has_a_formula():
    for name in (*WORKSHOP.library, *WORKSHOP.outside):
        effect: Drawn = WORKSHOP.draw(np.random.default_rng(4), name)
        assert pickle.loads(pickle.dumps(effect)) == effect  # noqa: S301
        assert all(number.name in WORKSHOP.formula(effect.scaled(0.5)) for number in effect.numbers)
