"""The latent friction: shares of made rows whose truth is known, and rows of made runs."""

from typing import Any

import numpy as np
import pytest

from diagnosis.latent.answer import LatentSignal, latent_of, named_by, signal_of
from diagnosis.latent.causes import DIRECTION, FORCE_PLACE, LOAD, NOISE, PLACE, SCATTER, TIME
from diagnosis.latent.rows import BREAKAWAY, SLIDING, ExcessRows
from diagnosis.latent.shares import LatentShare
from diagnosis.report.relations_block import latent_rows, latent_shares
from diagnosis.report.words import share_in_words
from tests.unit.diagnosis.relations.kinematic import rig, runs

ROWS = 90


def one_pass(wave_N: float, seed: int = 3, next_row: float = 0.0) -> ExcessRows:
    """Breakaways along a track, the last third held out; scatter with a correlation to the next row."""
    random = np.random.default_rng(seed)
    place = 1e-4 * np.arange(ROWS)
    excess_N = wave_N * np.sin(2.0 * np.pi * place / 2.5e-3) + scatter_N(random, next_row)
    return rows_of(BREAKAWAY, excess_N, np.ones(ROWS), place, 1e-3 * np.ones(ROWS))


def to_and_fro(push_N: float, along_N: float, seed: int = 4, next_row: float = 0.0) -> ExcessRows:
    """Sliding of an axis with a constant push, and a force that depends on the position whatever the direction."""
    random = np.random.default_rng(seed)
    phase = 2.0 * np.pi * 6.0 * np.arange(ROWS) / ROWS
    place, sign = 0.1 * np.sin(phase), np.where(np.cos(phase) >= 0.0, 1.0, -1.0)
    excess_N = sign * (push_N + along_N * np.sin(60.0 * place)) + scatter_N(random, next_row)
    return rows_of(SLIDING, excess_N, sign, place, 0.1 * np.abs(np.cos(phase)) + 1e-3)


def scatter_N(random: np.random.Generator, next_row: float) -> np.ndarray:
    values = random.normal(0.0, 0.1, ROWS)
    for i in range(1, ROWS):
        values[i] = next_row * values[i - 1] + (1.0 - next_row**2) ** 0.5 * values[i]
    return values


def rows_of(
    signal: str, excess_N: np.ndarray, sign: np.ndarray, place_m: np.ndarray, speed_mps: np.ndarray
) -> ExcessRows:
    held_out = np.arange(ROWS) >= 60
    return ExcessRows(
        signal, excess_N, sign, place_m, 0.1 * np.arange(ROWS), speed_mps, held_out.astype(int), held_out,
        None, None, None, 0.02,
    )  # fmt: skip


def of(signal: LatentSignal, what: str) -> LatentShare:
    return next(share for share in signal.shares if share.what == what)


def true_share(rows: ExcessRows, course_N: np.ndarray) -> float:
    """Share of a prediction that is the true course."""
    course, y = (values - values[~rows.held_out].mean() for values in (course_N, rows.excess_N))
    held = rows.held_out
    return float(course[held] @ (2.0 * y - course)[held]) / float(y[held] @ y[held])


def test_a_wave_along_the_track_is_found_with_its_share():
    rows = one_pass(0.3)
    signal = signal_of(rows)
    wave = of(signal, PLACE)
    assert wave.share == pytest.approx(0.045 / 0.055, abs=0.1)
    assert wave.share == pytest.approx(true_share(rows, 0.3 * np.sin(2.0 * np.pi * rows.place_m / 2.5e-3)), abs=0.1)
    assert wave.null_90 is not None
    assert wave.interval_90 is not None
    assert wave.null_90 < wave.interval_90[0] <= wave.share <= wave.interval_90[1]
    assert not signal.varies_slowly
    assert named_by([signal]) == (PLACE,)


@pytest.mark.parametrize("rows", [one_pass(0.3), one_pass(0.0), to_and_fro(0.1, 0.2), one_pass(0.1, 8, 0.9)])
def test_shares_and_what_is_left_add_up_and_none_is_dropped(rows: ExcessRows):
    signal = signal_of(rows)
    assert sum(share.share for share in signal.shares) == pytest.approx(1.0)
    assert len(latent_shares([signal])) == len(signal.shares)
    assert of(signal, NOISE).share == pytest.approx((0.02 / signal.differs) ** 2)
    assert signal.left == pytest.approx(signal.differs * (of(signal, SCATTER).share + of(signal, NOISE).share) ** 0.5)


def test_nothing_of_the_held_out_rows_enters_the_fit():
    rows = one_pass(0.3)
    other = rows._replace(excess_N=np.where(rows.held_out, rows.excess_N + 1.0, rows.excess_N))
    assert of(signal_of(rows), PLACE).null_90 == of(signal_of(other), PLACE).null_90
    # the wave is the same, and the level that it does not predict is ten times as large
    assert of(signal_of(other), PLACE).share < 0.2


@pytest.mark.slow
@pytest.mark.parametrize("next_row", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("record", [one_pass, to_and_fro])
def test_records_without_a_cause_have_no_name(record: Any, next_row: float):
    args = (0.0,) if record is one_pass else (0.0, 0.0)
    named = [named_by([signal_of(record(*args, seed, next_row))]) for seed in range(100, 120)]
    assert sum(map(bool, named)) <= 1


def test_a_slow_course_is_neither_one_over_place_nor_one_over_time():
    rows = one_pass(0.0)
    rows = rows._replace(excess_N=rows.excess_N + np.sin(3.0 * rows.place_m / np.ptp(rows.place_m)))
    signal = signal_of(rows)
    assert signal.varies_slowly
    assert named_by([signal]) == ()
    assert not signal_of(one_pass(0.0)).varies_slowly


def in_runs(levels_N: list[float], load_N: list[float]) -> ExcessRows:
    """Runs of 15 rows with a level and a load each, the last one held out."""
    rows = one_pass(0.0)
    run = np.arange(ROWS) // 15
    return rows._replace(
        run=run,
        held_out=run == run.max(),
        load_N=np.array(load_N)[run],
        excess_N=rows.excess_N + np.array(levels_N)[run],
    )


def test_a_cause_that_acts_between_runs_has_a_share():
    load_N = [10.0, 14.0, 11.0, 16.0, 13.0, 18.0]
    signal = signal_of(in_runs([0.2 * load for load in load_N], load_N))
    load = of(signal, LOAD)
    assert load.share > 0.9
    assert load.agrees
    assert load.beyond_chance


def test_a_size_that_differs_from_run_to_run_is_no_name():
    rows = one_pass(0.3)
    # the wave of the held-out run is twice as large
    grown = rows._replace(excess_N=np.where(rows.held_out, 2.0 * rows.excess_N, rows.excess_N))
    signal = signal_of(grown)
    assert of(signal, PLACE).beyond_chance
    assert of(signal, PLACE).share > 0.5
    assert not of(signal, PLACE).agrees
    assert named_by([signal]) == ()


def test_scatter_alone_has_no_name():
    signal = signal_of(one_pass(0.0))
    assert named_by([signal]) == ()
    assert of(signal, SCATTER).share > 0.5


def test_a_share_is_a_cause_only_where_its_whole_interval_exceeds_chance():
    signal = signal_of(one_pass(0.3))
    assert latent_rows([signal])[0].causes == (PLACE,)
    wave = of(signal, PLACE)
    assert wave.interval_90 is not None
    within = wave._replace(null_90=0.5 * (wave.interval_90[0] + wave.share))
    assert within.null_90 is not None
    assert within.share > within.null_90
    assert latent_rows([signal._replace(shares=(within,))])[0].causes == ()


def test_a_negative_share_is_written_as_such():
    wave = of(signal_of(one_pass(0.3)), PLACE)._replace(share=-0.4, interval_90=(-0.6, 0.1))
    shown = latent_shares([signal_of(one_pass(0.3))._replace(shares=(wave,))])[0]
    assert share_in_words(shown).startswith(f"{PLACE} -40 % (90 %: -60 % to 10 %)")


def test_a_force_that_depends_on_position_is_not_named_as_friction():
    rows = to_and_fro(0.0, 0.3)
    signal = signal_of(rows)
    course_N = rows.sign * 0.3 * np.sin(60.0 * rows.place_m)
    assert of(signal, FORCE_PLACE).share == pytest.approx(true_share(rows, course_N), abs=0.1)
    assert of(signal, FORCE_PLACE).beyond_chance
    assert named_by([signal]) == ()


def test_a_push_is_a_matter_of_direction():
    signal = signal_of(to_and_fro(0.4, 0.0))
    assert of(signal, DIRECTION).share == pytest.approx(0.16 / 0.17, abs=0.1)
    assert named_by([signal]) == (DIRECTION,)


def test_a_drift_over_an_axis_that_comes_back_is_one_over_time():
    rows = to_and_fro(0.0, 0.0)
    signal = signal_of(rows._replace(excess_N=rows.excess_N + 0.1 * rows.t_s))
    assert of(signal, TIME).share > 0.9
    assert named_by([signal]) == (TIME,)


@pytest.mark.slow
def test_every_slip_of_a_run_is_a_row_at_its_place():
    signals = {signal.signal: signal for signal in latent_of(rig(), [_quiet(run) for run in runs()])}
    assert set(signals) == {BREAKAWAY, SLIDING}
    assert signals[BREAKAWAY].rows > 60


def _quiet(run):
    commands = run.commands._replace(frequency_Hz=np.zeros_like(run.commands.frequency_Hz))
    return run._replace(commands=commands, noise=run.noise._replace(pieces={"drive_force_N": np.array([-6e-3, 6e-3])}))
