"""The generator is right about the rig, about each effect, and gives nothing away."""

import ast
import pickle
import tomllib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from tests.blind.generator import LIBRARY, OUTSIDE, OUTSIDE_2, Case, Effect, draw_effect, make, simulate
from tests.blind.generator.kernel import SAMPLE_RATE_HZ
from tests.blind.generator.library import formulas_of
from tests.blind.generator.rig import BACKBONES, DESCRIBED, draw_rig, draw_starts
from tests.blind.generator.runs import PROTOCOL, Plan, tracks_of

pytestmark = pytest.mark.slow

EXACT = {"tolerances": 0.0, "roughness": 0.0, "sensors": 0.0, "backbone": "lugre"}
STIFFNESS_N_per_m = DESCRIBED["drive_stiffness_N_per_m"]
# slips, slides the other way through zero force, and vibrates, in 2 s: every mechanism has a part in it
BUSY = (Plan(drive=((0.0, 2e-3), (0.9, -3e-3)), vibration=((0.3, 2000.0), (1.5, 4000.0)), duration_s=2.0),)
SLOW = (Plan(drive=((0.0, 0.5e-3),), duration_s=3.2),)
NAMES = (*LIBRARY, *OUTSIDE, *OUTSIDE_2)
FORMULAS = [
    pytest.param(formula, id=f"{formula.effect}-{formula.name}", marks=[pytest.mark.nightly] * (name in OUTSIDE))
    for name in NAMES
    for formula in formulas_of(name)
]
SIGNALS = ("drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m")


def _with(name: str, formula: str | None = None, **numbers: float) -> Case:
    chosen = next(f for f in formulas_of(name) if formula in (None, f.name))
    drawn = chosen.draw(np.random.default_rng(0))
    return Case(effects=(Effect(chosen, {**drawn, **numbers}),), **EXACT)


def _change(one: dict[str, np.ndarray], other: dict[str, np.ndarray]) -> float:
    """Largest rms difference of a signal, as a share of the signal's own swing."""
    return max(float(np.sqrt(np.mean((one[k] - other[k]) ** 2)) / other[k].std()) for k in SIGNALS)


def _slips(force_N: np.ndarray) -> np.ndarray:
    fallen = force_N[400:] - force_N[:-400] < -0.5  # 0.5 N within 20 ms
    return np.flatnonzero(fallen[1:] & ~fallen[:-1])


@pytest.fixture(scope="module")
def busy():
    return simulate(Case(**EXACT), 3, BUSY)[0]


@pytest.fixture(scope="module")
def slow():
    return simulate(Case(**EXACT), 3, SLOW)[0]


def test_the_paper_s_cycle_without_vibration():
    force = simulate(Case(**EXACT), 1, (Plan(drive=((0.0, 0.5e-3),), duration_s=7.0),))[0]["drive_force_N"]
    settled = force[4 * SAMPLE_RATE_HZ :]
    assert np.diff(_slips(settled)) / SAMPLE_RATE_HZ == pytest.approx(1.028, abs=0.001)
    assert settled.max() == pytest.approx(17.38, abs=0.01)
    assert settled.min() == pytest.approx(11.60, abs=0.01)


def test_stick_slip_at_3_kHz_and_none_at_4_kHz():
    plan = Plan(drive=((0.0, 0.5e-3),), vibration=((0.2, 3000.0), (5.0, 4000.0)), duration_s=8.0)
    force = simulate(Case(**EXACT), 1, (plan,))[0]["drive_force_N"]
    at_3_kHz, at_4_kHz = force[4 * SAMPLE_RATE_HZ : 5 * SAMPLE_RATE_HZ], force[7 * SAMPLE_RATE_HZ :]
    assert at_3_kHz.max() == pytest.approx(15.39, abs=0.02)
    assert at_3_kHz.min() == pytest.approx(13.59, abs=0.02)
    assert at_4_kHz.max() == pytest.approx(15.00, abs=0.01)
    assert np.ptp(at_4_kHz) < 0.01


@pytest.mark.parametrize("backbone", BACKBONES)
def test_half_the_step_gives_the_same_run(backbone):
    case = Case(backbone=backbone, roughness=1.0, sensors=0.0)
    coarse, fine = (simulate(case, 5, BUSY, finer)[0] for finer in (1, 2))
    assert np.abs(coarse["drive_force_N"] - fine["drive_force_N"]).max() < 1e-3
    assert np.abs(coarse["mass_position_m"] - fine["mass_position_m"]).max() < 1e-7


def test_a_slip_four_times_as_fast_takes_finer_steps():
    numbers = {"static-level": np.log(1.25), "coulomb-level": np.log(0.78)}
    effects = [_with(name, log_change=change).effects[0] for name, change in numbers.items()]
    case = Case(effects=tuple(effects), **{**EXACT, "backbone": "multi-element"})
    coarse, fine = (simulate(case, 5, BUSY, finer)[0] for finer in (1, 2))
    assert np.abs(coarse["drive_force_N"] - fine["drive_force_N"]).max() < 1e-3


def test_a_third_of_the_rigs_follow_another_friction_law():
    rigs = [draw_rig(np.random.default_rng(seed), None, 1.0)[0] for seed in range(300)]
    other = sum(r["elements"] > 1 or r["lorentzian"] > 0 or r["stribeck_exponent"] != 2.0 for r in rigs)
    assert other / len(rigs) == pytest.approx(1 / 3, abs=0.08)
    assert all(r["static_force_N"] > 1.02 * r["coulomb_force_N"] for r in rigs)
    assert all(r["stiffness_share"].sum() == pytest.approx(1.0) == pytest.approx(r["force_share"].sum()) for r in rigs)


def test_the_library_has_the_26_names_and_the_outside_none_of_them():
    assert len(LIBRARY) == 26
    assert len(OUTSIDE) >= 10
    assert len(OUTSIDE_2) >= 8
    assert len({*NAMES}) == len(NAMES)


@pytest.mark.parametrize("formula", FORMULAS)
def test_an_effect_shows_at_1_and_fades_towards_0(formula, busy):
    effect = Effect(formula, formula.draw(np.random.default_rng(1)))
    full, faint = (simulate(Case(effects=(effect.scaled(s),), **EXACT), 3, BUSY)[0] for s in (1.0, 0.003))
    assert all(np.isfinite(full[name]).all() for name in full)
    assert _change(full, busy) > 0.01
    assert 0.0 < _change(faint, busy) < 0.3 * _change(full, busy)


def test_strength_0_has_no_effect(busy):
    effects = tuple(draw_effect(np.random.default_rng(2), name).scaled(0.0) for name in NAMES)
    still = simulate(Case(effects=effects, **EXACT), 3, BUSY)[0]
    assert all(np.array_equal(still[name], busy[name]) for name in busy)


@pytest.mark.parametrize("name", ["force-sensor-gain", "static-level"])
def test_the_counterfactual_has_the_same_rig_and_the_same_noise(name):
    """Signals before an effect acts differ by a count of the recorder at most: 0.1 um."""
    effect = draw_effect(np.random.default_rng(4), name)
    with_it, without = (simulate(Case(effects=e), 9, BUSY)[0] for e in ((effect,), ()))
    before = slice(0, 1000)  # 50 ms: the spring is below breakaway
    assert np.abs(with_it["mass_position_m"] - without["mass_position_m"])[before].max() < 0.11e-6


def test_effects_travel_to_workers():
    effect = draw_effect(np.random.default_rng(4), "drive-backlash")
    assert pickle.loads(pickle.dumps(effect)) == effect  # noqa: S301


# closed forms


def test_gain_bias_and_delay_of_the_force_sensor(busy):
    force = busy["drive_force_N"]
    gain = simulate(_with("force-sensor-gain", error=0.2), 3, BUSY)[0]["drive_force_N"]
    assert gain == pytest.approx(1.2 * force, rel=1e-12)
    bias = simulate(_with("force-sensor-bias", bias_N=-1.5), 3, BUSY)[0]["drive_force_N"]
    assert bias == pytest.approx(force - 1.5, abs=1e-12)
    delay = simulate(_with("force-sensor-delay", delay_s=0.002), 3, BUSY)[0]["drive_force_N"]
    assert delay[40:] == pytest.approx(force[:-40], abs=1e-9)


def test_a_lagging_force_sensor_is_late_by_its_time_constant(slow):
    lagged = simulate(_with("force-sensor-lag", corner_Hz=30.0, order=1.0), 3, SLOW)[0]["drive_force_N"]
    stuck = slice(4000, 6000)
    slope = np.gradient(slow["drive_force_N"])[stuck].mean() * SAMPLE_RATE_HZ
    late_s = (slow["drive_force_N"] - lagged)[stuck].mean() / slope
    assert late_s == pytest.approx(1.0 / (2.0 * np.pi * 30.0), rel=1e-3)


def test_an_accelerometer_s_gain_is_its_own(busy):
    case = _with("accelerometer-gain", mass_accel_mps2=0.0, base_accel_mps2=-0.2)
    scaled = simulate(case, 3, BUSY)[0]
    assert np.array_equal(scaled["mass_accel_mps2"], busy["mass_accel_mps2"])
    assert scaled["base_accel_mps2"] == pytest.approx(0.8 * busy["base_accel_mps2"], rel=1e-12)


def test_static_level_moves_the_peak_of_the_force(slow):
    raised = simulate(_with("static-level", log_change=np.log(1.15)), 3, SLOW)[0]
    assert raised["drive_force_N"].max() / slow["drive_force_N"].max() == pytest.approx(1.15, rel=1e-3)


@pytest.mark.parametrize(
    ("name", "numbers", "stiffness"),
    [
        ("drive-stiffness", {"log_change": np.log(1.2)}, 1.2 * STIFFNESS_N_per_m),
        (
            "frame-compliance",
            {"stiffness_N_per_m": 5.0 * STIFFNESS_N_per_m, "damping_ratio": 0.5},
            STIFFNESS_N_per_m * 5.0 / 6.0,
        ),
    ],
)
def test_the_slope_of_a_stuck_rig_is_its_stiffness(name, numbers, stiffness):
    force = simulate(_with(name, **numbers), 3, SLOW)[0]["drive_force_N"]
    stuck = slice(4000, 8000)
    contact = DESCRIBED["contact_stiffness_N_per_m"]
    slope = np.polyfit(np.arange(4000) / SAMPLE_RATE_HZ, force[stuck], 1)[0]
    assert slope == pytest.approx(0.5e-3 * stiffness * contact / (stiffness + contact), rel=1e-3)


def test_drive_damping_adds_its_force_while_stuck(slow):
    damped = simulate(_with("drive-damping", "kelvin-voigt", damping_Ns_per_m=40.0), 3, SLOW)[0]["drive_force_N"]
    assert (damped - slow["drive_force_N"])[4000:6000].mean() == pytest.approx(40.0 * 0.5e-3, rel=0.01)


def test_backlash_is_the_drive_s_way_through_zero_force(busy):
    played = simulate(_with("drive-backlash", backlash_m=200e-6), 3, BUSY)[0]

    def way_m(run):
        after = slice(int(1.0 * SAMPLE_RATE_HZ), None)
        stretch = (run["drive_position_m"] - run["mass_position_m"])[after]
        return np.ptp(np.interp([-4.0, 4.0], run["drive_force_N"][after][::-1], stretch[::-1]))

    assert way_m(played) - way_m(busy) == pytest.approx(200e-6, rel=0.02)


def test_roll_off_takes_its_factor_off_the_base_s_acceleration(busy):
    rolled = simulate(_with("piezo-roll-off", "first-order", corner_Hz=3000.0), 3, BUSY)[0]
    for at_s, frequency_Hz in ((1.0, 2000.0), (1.7, 4000.0)):
        steady = slice(int(at_s * SAMPLE_RATE_HZ), int((at_s + 0.2) * SAMPLE_RATE_HZ))
        left = rolled["base_accel_mps2"][steady].std() / busy["base_accel_mps2"][steady].std()
        assert left == pytest.approx((1.0 + (frequency_Hz / 3000.0) ** 2) ** -0.5, rel=1e-4)


def test_the_base_s_acceleration_matches_the_commanded_vibration(busy):
    steady = slice(SAMPLE_RATE_HZ, int(1.2 * SAMPLE_RATE_HZ))
    amplitude = busy["base_accel_mps2"][steady].std() * np.sqrt(2.0)
    assert amplitude == pytest.approx(0.02e-6 * (2.0 * np.pi * 2000.0) ** 2, rel=1e-4)


def test_a_screw_errs_alike_wherever_a_run_begins():
    """The phase of its wave over the drive's own position is the same in two runs, although the spring starts stretched."""
    case = _with("drive-speed-ripple", "screw-pitch", pitch_m=1e-3, depth=0.03, harmonic=0.0)
    phases = []
    for signals in simulate(case, 3, (replace(SLOW[0], duration_s=6.0),) * 2):
        position_m, t_s = signals["drive_position_m"], signals["t_s"]
        angle = 2.0 * np.pi * position_m / 1e-3
        columns = np.stack([np.sin(angle), np.cos(angle), t_s, np.ones_like(t_s)], axis=1)
        sine, cosine, *_ = np.linalg.lstsq(columns, position_m, rcond=None)[0]
        phases.append(np.arctan2(cosine, sine))
    assert phases[0] == pytest.approx(phases[1], abs=0.05)


# the folder


def test_same_case_and_seed_same_bytes_other_seed_other_bytes(tmp_path):
    case = Case(effects=(draw_effect(np.random.default_rng(1), "debris-bursts"),))
    for name, seed in (("a", 3), ("b", 3), ("c", 4)):
        make(tmp_path / name, case, seed, BUSY)
    a, b, c = ((tmp_path / name / "run-01.parquet").read_bytes() for name in "abc")
    assert a == b
    assert a != c


def test_a_folder_does_not_reveal_its_effect(tmp_path):
    plans = tuple(replace(plan, duration_s=2.5) for plan in PROTOCOL)
    make(tmp_path / "with", Case(effects=(draw_effect(np.random.default_rng(1), "friction-drift"),)), 11, plans)
    make(tmp_path / "without", Case(), 11, plans)
    files = [sorted(p.name for p in (tmp_path / side).iterdir()) for side in ("with", "without")]
    assert files[0] == files[1] == ["manifest.toml", *(f"run-{n:02d}.parquet" for n in range(1, 5))]
    manifests = [(tmp_path / side / "manifest.toml").read_bytes() for side in ("with", "without")]
    assert manifests[0] == manifests[1]
    runs = tomllib.loads(manifests[0].decode())["run"]
    assert [run["holdout"] for run in runs] == [False, False, False, True]
    assert [run.get("drive_velocity_mps") for run in runs] == [0.0005, None, 0.0005, None]
    for name in files[0][1:]:
        one, other = (tmp_path / side / name for side in ("with", "without"))
        assert one.stat().st_size == pytest.approx(other.stat().st_size, rel=0.1)
        assert pq.read_schema(one).equals(pq.read_schema(other), check_metadata=True)
        heads = [pq.read_metadata(p) for p in (one, other)]
        assert heads[0].metadata == heads[1].metadata
        assert heads[0].num_rows == heads[1].num_rows == 2.5 * SAMPLE_RATE_HZ


def test_the_protocol_is_four_runs_of_ten_seconds_on_their_own_pieces_of_track():
    assert [plan.duration_s for plan in PROTOCOL] == [10.0] * 4
    starts = draw_starts(np.random.default_rng(0), 4)
    assert all(0.012 <= start.position_m <= 0.030 and 0.2 <= start.force_share <= 0.8 for start in starts)
    places = sorted(int((start.position_m - 0.012) / 0.0045) for start in starts)
    assert places == [0, 1, 2, 3]


def test_a_column_can_be_left_out(tmp_path):
    make(tmp_path, Case(leave_out=("drive_position_m",)), 2, BUSY)
    assert "drive_position_m" not in pq.read_schema(tmp_path / "run-01.parquet").names
    with pytest.raises(ValueError, match="leave_out"):
        Case(leave_out=("t_s",))


def test_vibration_changes_its_frequency_only_at_rest():
    tracks = tracks_of(BUSY[0], 0)
    changes = np.flatnonzero(np.diff(tracks.frequency_Hz)) + 1
    assert len(changes) == 2
    assert (tracks.amplitude_m[changes] == 0.0).all()


def test_the_generator_shares_no_code_with_the_diagnosis():
    allowed = {"numpy", "scipy", "numba", "pyarrow", "tests"}
    for path in (Path(__file__).parent / "generator").glob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            names = [node.module or ""] if isinstance(node, ast.ImportFrom) else []
            names += [alias.name for alias in node.names] if isinstance(node, ast.Import) else []
            for name in names:
                assert not name.startswith(("plant", "diagnosis", "bridge", "controller", "cockpit")), path
                if name.startswith("tests"):
                    assert name.startswith("tests.blind.generator"), path
                elif name.split(".")[0] not in allowed:
                    assert name.split(".")[0] in __import__("sys").stdlib_module_names, path
