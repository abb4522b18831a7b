"""The latent friction: shares of made rows whose truth is known, and rows of made runs."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagnosis.latent.answer import LatentSignal, latent_of, signal_of
from diagnosis.latent.components import DIRECTION, FORCE_PLACE, PLACE, SCATTER
from diagnosis.latent.rows import BREAKAWAY, MOST_ROWS, SLIDING, ExcessRows
from diagnosis.latent.shares import LatentShare
from diagnosis.report.relations_block import latent_rows
from diagnosis.report.words import latent_line
from diagnosis.verdict.by_latent import named_by, with_latent
from diagnosis.verdict.judge import Verdict
from tests.unit.diagnosis.relations.kinematic import rig, runs

ROWS = 90


def one_pass(wave_N: float) -> ExcessRows:
    """Breakaways along a track, the last third held out."""
    random = np.random.default_rng(3)
    place = 1e-4 * np.arange(ROWS)
    excess_N = wave_N * np.sin(2.0 * np.pi * place / 2.5e-3) + random.normal(0.0, 0.1, ROWS)
    held_out = np.arange(ROWS) >= 60
    ones = np.ones(ROWS)
    return ExcessRows(
        BREAKAWAY, excess_N, ones, place, 0.1 * np.arange(ROWS), 1e-3 * ones, held_out.astype(int), held_out,
        None, None, None, 0.02,
    )  # fmt: skip


def to_and_fro(push_N: float, along_N: float) -> ExcessRows:
    """Sliding of an axis with a constant push, and a force that depends on the position whatever the direction."""
    random = np.random.default_rng(4)
    phase = 2.0 * np.pi * 6.0 * np.arange(ROWS) / ROWS
    place, sign = 0.1 * np.sin(phase), np.where(np.cos(phase) >= 0.0, 1.0, -1.0)
    excess_N = sign * (push_N + along_N * np.sin(60.0 * place)) + random.normal(0.0, 0.1, ROWS)
    held_out = np.arange(ROWS) >= 60
    return ExcessRows(
        SLIDING, excess_N, sign, place, 0.1 * np.arange(ROWS), 0.1 * np.abs(np.cos(phase)) + 1e-3, held_out.astype(int),
        held_out, None, None, None, 0.02,
    )  # fmt: skip


def of(signal: LatentSignal, what: str) -> LatentShare:
    return next(share for share in signal.shares if share.what == what)


def test_a_wave_along_the_track_is_found_with_its_share():
    signal = signal_of(one_pass(0.3))
    wave = of(signal, PLACE)
    assert wave.share == pytest.approx(0.045 / 0.055, abs=0.1)
    assert wave.null_90 is not None
    assert wave.null_90 < wave.interval_90[0] <= wave.interval_90[1]
    assert sum(share.share for share in signal.shares) == pytest.approx(1.0)
    assert not signal.revisited
    assert named_by([signal]) == (PLACE,)


def test_scatter_alone_has_no_name():
    signal = signal_of(one_pass(0.0))
    assert named_by([signal]) == ()
    assert of(signal, SCATTER).share > 0.5


def test_a_share_is_a_cause_only_where_its_whole_interval_exceeds_chance():
    signal = signal_of(one_pass(0.3))
    assert latent_rows([signal])[0].causes == (PLACE,)
    wave = of(signal, PLACE)
    within = wave._replace(null_90=0.5 * (wave.interval_90[0] + wave.share))
    assert within.null_90 is not None
    assert within.share > within.null_90
    assert latent_rows([signal._replace(shares=(within,))])[0].causes == ()
    assert latent_line([signal._replace(shares=(within,))]) == ""


@pytest.mark.slow
def test_a_force_that_depends_on_position_is_not_named_as_friction():
    signal = signal_of(to_and_fro(0.0, 0.3))
    assert of(signal, FORCE_PLACE).share > 0.7
    assert of(signal, PLACE).share < 0.1
    assert signal.revisited


@pytest.mark.slow
def test_a_push_is_a_matter_of_direction():
    signal = signal_of(to_and_fro(0.4, 0.0))
    assert of(signal, DIRECTION).share == pytest.approx(0.16 / 0.17, abs=0.1)


def test_unexplained_becomes_partly_by_a_named_share_and_other_verdicts_stay():
    signal = signal_of(one_pass(0.3))
    names = (PLACE, "none", "unexplained")
    verdict = Verdict("unexplained", None, dict.fromkeys(names, 1.0 / 3.0), None, (), 1.0)
    after = with_latent(verdict, [signal], None)
    assert (after.kind, after.names) == ("partly", (PLACE,))
    assert sum(after.probabilities.values()) == pytest.approx(1.0)
    assert with_latent(verdict._replace(kind="no-gap"), [signal], None).kind == "no-gap"
    assert with_latent(verdict._replace(refuted=(PLACE,)), [signal], None).kind == "unexplained"
    assert with_latent(verdict, [signal._replace(judged_on_held_out=False)], None).kind == "unexplained"


@pytest.mark.parametrize(("left", "kind"), [(1.6, "no-gap"), (20.5, "partly")])
@pytest.mark.slow
def test_no_gap_becomes_partly_where_the_held_out_runs_show_one(left: float, kind: str):
    verdict = Verdict("no-gap", None, dict.fromkeys((PLACE, "none", "unexplained"), 1.0 / 3.0), None, (), 1.0)
    held_out: Any = SimpleNamespace(retuned=left)
    assert with_latent(verdict, [signal_of(one_pass(0.3))], held_out).kind == kind


@pytest.mark.slow
def test_every_slip_of_a_run_is_a_row_at_its_place():
    signals = {signal.signal: signal for signal in latent_of(rig(), [_quiet(run) for run in runs()])}
    assert set(signals) == {BREAKAWAY, SLIDING}
    assert 60 < signals[BREAKAWAY].rows <= MOST_ROWS


def _quiet(run):
    commands = run.commands._replace(frequency_Hz=np.zeros_like(run.commands.frequency_Hz))
    return run._replace(commands=commands, noise=run.noise._replace(pieces={"drive_force_N": np.array([-6e-3, 6e-3])}))
