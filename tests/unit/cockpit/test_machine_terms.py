"""Following error, quadrant error and dose, against motions worked out by hand."""

import json
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from typer.testing import CliRunner

from bridge.log.logfile import read_run
from bridge.log.storage.verdict_file import verdict_path
from bridge.results import strict_json
from bridge.wire import stickslip_pb2 as wire
from cockpit.cli import app
from cockpit.commands.as_json.schemas import FORMATS
from cockpit.judge.judged import judge_log
from cockpit.judge.machine_terms import BlockMotion, Following, FollowingSum, reversals_of
from cockpit.judge.verdict_words import following_in_words, in_words
from tests.logs import doctored, verdict_of

T_S = (np.arange(4000) + 1) * 1e-3


def following(motion: BlockMotion, from_s: float) -> tuple[Following | None, float]:
    """Of the blocks from a time on; and the dose."""
    terms = FollowingSum()
    terms.add(motion, lambda t_s: t_s > from_s)
    return terms.result(1e-3), terms.dose_mm2_per_s


def made_turn(noise_m: float = 0.0) -> tuple[np.ndarray, np.ndarray]:
    """Slide and drive: the drive turns at 2 s; the slide rests for 0.3 s, is then 270 um behind, and 30 um 20 ms later."""
    random = np.random.default_rng(1)
    drive_m = np.where(T_S < 2.0, T_S, 4.0 - T_S) * 1e-3
    ahead_m = np.interp(T_S, [2.3, 2.32], [2.7e-4, 3e-5])  # on the way back
    slide_m = np.where(T_S < 2.0, drive_m - 3e-5, np.where(T_S < 2.3, 2e-3 - 3e-5, drive_m + ahead_m))
    return slide_m + noise_m * random.standard_normal(4000), drive_m + noise_m * random.standard_normal(4000)


@pytest.mark.parametrize("noise_m", [0.0, 2e-7])
@pytest.mark.parametrize("late", [0, 30])
def test_a_change_of_sign(noise_m: float, late: int) -> None:
    direction = np.where(np.arange(4000) < 2000 + late, 1, -1)
    (terms,) = reversals_of(T_S, *made_turn(noise_m), direction)
    assert terms.t_s == pytest.approx(2.0, abs=4e-3)
    assert terms.stick_s == pytest.approx(0.3, abs=8e-3)
    # the mean from the end of the stick on: 20 ms of 150 um, 1.68 s of 30 um
    mean_m = (0.02 * 1.5e-4 + 1.68 * 3e-5) / 1.7
    assert terms.quadrant_error_m == pytest.approx(2.7e-4 - mean_m, rel=0.02)


def test_a_slide_that_never_follows_sticks_to_the_end_of_the_stroke() -> None:
    drive_m = np.where(T_S < 2.0, T_S, 4.0 - T_S) * 1e-3
    slide_m = np.minimum(drive_m, 2e-3) * (T_S < 2.0) + 2e-3 * (T_S >= 2.0)
    (terms,) = reversals_of(T_S, slide_m, drive_m, np.where(T_S < 2.0, 1, -1))
    assert (terms.stick_s, terms.quadrant_error_m) == (pytest.approx(2.0, abs=4e-3), 0.0)


def test_a_stop_between_both_signs_does_not_count_as_part_of_the_stick() -> None:
    slide_m, drive_m = made_turn()
    wait = np.full(500, 0)
    t_s = (np.arange(4500) + 1) * 1e-3
    slide_m = np.concatenate([slide_m[:2000], slide_m[1999] + wait, slide_m[2000:]])
    drive_m = np.concatenate([drive_m[:2000], drive_m[1999] + wait, drive_m[2000:]])
    direction = np.concatenate([np.full(2000, 1), wait, np.full(2000, -1)])
    (terms,) = reversals_of(t_s, slide_m, drive_m, direction)
    assert (terms.t_s, terms.stick_s) == (pytest.approx(2.5, abs=4e-3), pytest.approx(0.3, abs=8e-3))


def test_following_error_of_a_stretch() -> None:
    """50 um behind forwards, then 30 and 50 um in turns backwards: 40 um ahead in the mean, 10 um rms about it."""
    direction = np.where(T_S <= 2.0, 1, -1)
    swing_m = np.where(np.arange(4000) % 2 == 0, 1e-5, -1e-5)
    error_m = np.where(T_S <= 2.0, 5e-5, -4e-5 + swing_m)
    motion = BlockMotion(
        T_S,
        error_m,
        direction,
        np.full(4000, 4e-9),
        reversals_of(T_S, -error_m, 0.0 * T_S, direction),
        np.arange(4000) % 4 == 0,
    )
    back, _ = following(motion, 2.0)
    assert back is not None
    assert back.moving_s == pytest.approx(2.0)
    assert back.error_peak_m == pytest.approx(5e-5)
    assert back.error_rms_m == pytest.approx(np.sqrt((3e-5**2 + 5e-5**2) / 2))
    assert back.error_ripple_m == pytest.approx(1e-5)
    assert back.following_s == pytest.approx(0.5)
    whole, _ = following(motion, 0.0)
    assert whole is not None
    assert whole.error_ripple_m == pytest.approx(1e-5 / np.sqrt(2.0))  # about the mean of each direction
    assert following(motion, 3.0)[1] == pytest.approx(1000 * 4e-9 * 1e6)
    assert following(motion._replace(error_m=None), 0.0)[0] is None


def test_pieces_of_a_stretch_are_the_stretch() -> None:
    """A ripple of 1 nm on an error of 10 mm, whose squares alone would lose it."""
    direction = np.where(np.arange(4000) % 1000 < 700, 1, -1)
    error_m = 0.01 * direction + 1e-9 * np.sin(np.arange(4000.0))
    follows = error_m > 0.0
    whole = BlockMotion(T_S, error_m, direction, 0.0 * T_S, [], follows)
    pieces = FollowingSum()
    for part in np.split(np.arange(4000), [3, 900, 901, 3100]):
        pieces.add(
            BlockMotion(T_S[part], error_m[part], direction[part], 0.0 * T_S[part], [], follows[part]),
            lambda t_s: np.ones(len(t_s), bool),
        )
    terms, expected = pieces.result(1e-3), following(whole, 0.0)[0]
    assert terms is not None
    assert expected is not None
    assert tuple(terms) == pytest.approx(tuple(expected), rel=1e-9)
    assert terms.error_ripple_m == pytest.approx(1e-9 / np.sqrt(2.0), rel=0.01)


def test_the_lines_of_a_stretch_compared_with_another() -> None:
    slide_m, drive_m = made_turn()
    direction = np.where(T_S < 2.0, 1, -1)
    reversals = reversals_of(T_S, slide_m, drive_m, direction)
    motion = BlockMotion(T_S, drive_m - slide_m, direction, 0.0 * T_S, reversals, direction > 0)
    terms, _ = following(motion, 0.0)
    assert terms is not None
    error, reversal = following_in_words(terms, terms, "before")
    assert error.startswith("error    following error ")
    assert reversal.startswith(
        "reversal quadrant error 239 um, the slide rests for 300 ms, the worst of 1 (before: 239 um"
    )


def test_the_dose_of_a_run_counts_only_blocks_in_which_the_exciter_moved(tmp_path: Path) -> None:
    def shake(tables):  # 100 blocks of 1 ms at 0.6 mm/s: 0.036 mm2/s; v_a of all other blocks is noise
        tables["trace"]["vibration_velocity_mps"] = 6e-4
        tables["applied"]["amplitude_m"] = 0.0
        tables["applied"]["amplitude_m"][200:300] = 4e-8

    path = doctored(tmp_path, shake)
    for from_s, dose_mm2_per_s in ((0.0, 0.036), (0.25, 0.018)):
        stretch = judge_log(path, stretch_from_s=from_s).judge.stretch
        assert stretch is not None
        assert stretch.vibration_dose_mm2_per_s == pytest.approx(dose_mm2_per_s)


def test_a_frozen_transducer_gives_no_following_error(tmp_path: Path) -> None:
    def stand(tables):
        tables["sensors"]["mass_position_m"] = 0.0

    run = read_run(doctored(tmp_path, stand))
    before = verdict_of(run).before
    assert before is not None
    assert before.following is None


def test_the_verdict_has_the_terms_of_the_stretch_after(tmp_path: Path) -> None:
    """In the first 0.4 s the slide rests, and the drive moves away from it."""

    def from_the_start(tables):
        tables["trace"]["state"] = wire.STICK

    run = read_run(doctored(tmp_path, from_the_start))
    configuration = '{"block_s": 0.001, "policy": {"enabled_from_s": 0.0}}'
    verdict = verdict_of(run._replace(headers=run.headers | {"controller": {"configuration": configuration}}))
    assert verdict.after is not None
    following = verdict.after.following
    assert following is not None
    way_m = float(run.sensors["drive_position_m"][-1].mean() - run.sensors["mass_position_m"][-1].mean())
    assert following.error_peak_m == pytest.approx(way_m, rel=0.05)
    assert any(line.startswith("error    following error") for line in in_words(verdict, verbose=True))
    assert strict_json(verdict)["after"]["following"]["error_peak_m"] == following.error_peak_m


@pytest.mark.slow
def test_a_run_is_compared_with_itself_without_the_controller(tmp_path: Path) -> None:
    log, table = tmp_path / "run.mcap", tmp_path / "run.json"
    words = [
        "run",
        "--in-process",
        "--without",
        "--scenario",
        "from-the-start",
        "--set",
        "duration_s=6.0",
        "--log",
        str(log),
    ]
    result = CliRunner().invoke(app, [*words, "--json", str(table)])
    assert result.exit_code == 0
    told = json.loads(table.read_text())
    jsonschema.validate(told, FORMATS["run-result"].schema(), jsonschema.Draft202012Validator)
    after, without = told["after"], told["without"]
    assert (after["slips"], after["seconds"]) == (0, without["seconds"])
    assert without["slips"] >= 3
    assert without["vibration_dose_mm2_per_s"] == 0.0 < after["vibration_dose_mm2_per_s"]
    assert without["following"]["error_ripple_m"] > after["following"]["error_ripple_m"]
    (line,) = (line for line in result.stdout.splitlines() if line.startswith("without "))
    assert line.endswith("simulated without the controller")
    assert json.loads(verdict_path(log).read_text())["without"] == without
