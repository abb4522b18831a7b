"""Which falls of the force of a run are slips, against motions worked out by hand."""

from pathlib import Path

import numpy as np
import pytest

from bridge.log.logfile import RunData, read_run
from cockpit.judge.judged import judge
from cockpit.judge.verdict import NOT_JUDGED
from cockpit.judge.verdict_words import in_words
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from tests.logs import Tables, cycles_of, doctored, verdict_of

STIFFNESS_N_PER_M = 1e6
SPEED_MPS = 1e-3


def made_run(folder: Path, drive_m: np.ndarray, behind_m: np.ndarray, places: bool = True) -> RunData:
    """A run of 400 blocks whose slide is so far behind its drive; [samples]."""
    count = len(drive_m)
    noise_N = 0.01 * np.random.default_rng(1).standard_normal(count)

    def make(tables: Tables) -> None:
        sensors = tables["sensors"]
        shape = sensors["drive_force_N"].shape
        sensors["drive_position_m"] = drive_m.reshape(shape)
        sensors["mass_position_m"] = (drive_m - behind_m).reshape(shape) if places else 0.0
        sensors["drive_force_N"] = (STIFFNESS_N_PER_M * behind_m + noise_N).reshape(shape)

    return read_run(doctored(folder, make))


T_S = np.arange(8000) / 20000.0  # 400 blocks of 20 samples


def sawtooth_m(t_s: np.ndarray) -> np.ndarray:
    """The slide sticks for 36 ms and slips by 40 um in 4 ms."""
    at = np.mod(t_s, 0.04)
    return np.where(at < 0.036, at * SPEED_MPS, 3.6e-5 * (0.04 - at) / 0.004) + 2e-5


def test_slips_count_in_both_directions_and_a_reversal_does_not(tmp_path: Path) -> None:
    drive_m = SPEED_MPS * np.where(T_S < 0.2, T_S, 0.4 - T_S)
    behind_m = np.where(T_S < 0.2, 1.0, -1.0) * sawtooth_m(np.mod(T_S, 0.2))
    cycles = cycles_of(made_run(tmp_path, drive_m, behind_m))
    assert cycles is not None
    assert cycles.slips == 10
    assert np.sign(cycles.breakaway_force_N).tolist() == [1.0] * 5 + [-1.0] * 5
    assert np.mod(cycles.breakaway_t_s, 0.04) == pytest.approx(0.036, abs=2e-3)


def test_the_force_swing_counts_inside_a_stroke_and_not_where_the_drive_turns_or_rests(tmp_path: Path) -> None:
    at_s = np.mod(T_S, 0.16)  # 50 ms forwards, 30 ms of a stop, in which the spring lets go, and the same backwards
    there_s, back_s = np.minimum(at_s, 0.05), np.clip(at_s - 0.08, 0.0, 0.05)
    stands = np.mod(T_S, 0.08) > 0.05
    way = np.where(at_s < 0.08, 1.0, -1.0)
    behind_m = np.where(stands, 0.0, way * (2e-5 + 4e-6 * np.sin(2 * np.pi * T_S / 0.01)))
    run = made_run(tmp_path, SPEED_MPS * (there_s - back_s), behind_m)
    whole = verdict_of(run).before
    assert whole is not None
    assert whole.swing_N == pytest.approx(8.0, rel=0.1)
    assert whole.strokes == 2
    assert "drive force swings by 7.87 N" in "\n".join(in_words(verdict_of(run), verbose=False))


@pytest.mark.parametrize("places", [True, False])
def test_a_slide_that_comes_after_a_drive_that_stops_does_not_slip(tmp_path: Path, places: bool) -> None:
    drive_m = SPEED_MPS * np.minimum(T_S, 0.2)
    coasts_m = np.clip((T_S - 0.2) * SPEED_MPS, 0.0, 1e-5)
    cycles = cycles_of(made_run(tmp_path, drive_m, 5e-5 - coasts_m, places))
    assert cycles is not None
    assert cycles.slips == 0


@pytest.mark.parametrize(("swing", "slips"), [(0.2, 0), (0.9, 4)])
def test_a_drive_that_rings_does_not_slip_until_the_slide_runs_ahead(tmp_path: Path, swing: float, slips: int) -> None:
    rad_per_s = 2.0 * np.pi / 0.1
    behind_m = 2e-5 + swing * SPEED_MPS / rad_per_s * np.cos(rad_per_s * T_S)  # v_s = v_d (1 + swing sin)
    cycles = cycles_of(made_run(tmp_path, SPEED_MPS * T_S, behind_m))
    assert cycles is not None
    assert cycles.slips == slips


def test_a_place_that_froze_hides_no_slip(tmp_path: Path) -> None:
    run = made_run(tmp_path, SPEED_MPS * T_S, sawtooth_m(T_S))
    frozen = run.sensors.copy()
    frozen["mass_position_m"][100:] = frozen["mass_position_m"][100, 0]
    cycles = cycles_of(run._replace(sensors=frozen))
    assert cycles is not None
    assert cycles.slips == 10


def test_noise_of_the_positions_makes_no_slip_of_a_slow_fall_on_a_stiff_spring(tmp_path: Path) -> None:
    """The slide outruns its drive by less than its noise: half of such falls were slips."""
    run = made_run(tmp_path, SPEED_MPS * T_S, np.full(8000, 2e-5))
    sensors = run.sensors.copy()
    shape = sensors["drive_force_N"].shape
    sensors["drive_force_N"] = (65.0 + 2.5 * np.sin(2.0 * np.pi * T_S / 0.04)).reshape(shape)
    sensors["mass_position_m"] += 5e-7 * np.random.default_rng(1).standard_normal(shape)
    cycles = cycles_of(run._replace(sensors=sensors))
    assert cycles is not None
    assert cycles.slips == 0


@pytest.mark.parametrize(("until_s", "went_on"), [(0.1, False), (0.4, True)])
def test_slips_that_ended_do_not_go_on(tmp_path: Path, until_s: float, went_on: bool) -> None:
    before = verdict_of(made_run(tmp_path, SPEED_MPS * T_S, sawtooth_m(np.minimum(T_S, until_s)))).before
    assert before is not None
    assert (before.slips > 1, before.slips_went_on) == (True, went_on)


@pytest.mark.parametrize(
    ("profile", "why"),
    [
        ("[[0.0, 0.0005], [2.9, 0.0005], [2.95, 0.0]]", "the drive did not move"),
        ("[[0.0, 0.0005], [5.0, 0.0005], [5.1, 0.0]]", "between two slips before"),
    ],
)
@pytest.mark.slow
def test_a_drive_that_rests_while_the_controller_is_in_charge_shows_nothing(
    tmp_path: Path, profile: str, why: str
) -> None:
    settings = ["duration_s=6.0", "controller.policy.enabled_from_s=3.0", f"rig.drive.profile={profile}"]
    run_onboard(load_scenario("paper-c45-c45", settings), tmp_path / "run.mcap", {})
    verdict = judge(tmp_path / "run.mcap")
    assert verdict.control == NOT_JUDGED
    assert why in verdict.reason
