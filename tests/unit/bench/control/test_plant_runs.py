"""The judge of the bench on runs of the plant whose truth is known, with the rules that need no controller."""

import numpy as np
import pytest

from bench.control import record, rules
from bench.control.figures import SILENT, figures
from bench.control.oracle import is_clean
from bench.control.run import Judged, Subject, judge
from bench.control.scenario import BankScenario
from tests.bank import BANK

pytestmark = pytest.mark.slow  # together, not each
NAMED = {entry.name: entry for entry in BANK}
PAPER = NAMED["pair-c45-0.5"]


def shortened(scenario: BankScenario, duration_s: float) -> BankScenario:
    return scenario._replace(table=scenario.table | {"duration_s": duration_s})


def run(scenario: BankScenario, rule: int, ratio: float = 1.2) -> Judged:
    return judge(scenario, Subject(rule, ratio))


def of(judged: Judged, kind: int) -> np.ndarray:
    return judged.events[judged.events[:, 0] == kind, 1:]


def test_the_papers_rig_slips_once_a_period() -> None:
    judged = run(PAPER, rules.NONE)
    slips = of(judged, record.SLIPPED)
    assert len(slips) == 17
    np.testing.assert_allclose(np.diff(slips[1:, 0]), 1.028, atol=2e-3)  # tests/truth/test_paper.py
    np.testing.assert_allclose(slips[:, 5], 0.0223, atol=2e-4)
    assert len(of(judged, record.SURGED)) == 0
    sticks = of(judged, record.STUCK)
    # from the end of a slip to the begin of the next
    np.testing.assert_allclose(sticks[1:, 1], slips[1 : len(sticks), 0], atol=2e-3)


def test_the_way_back_is_judged_as_the_way_forth() -> None:
    forth, back = (run(NAMED[name], rules.NONE) for name in ("pair-c45-1", "return-only-backwards"))
    np.testing.assert_allclose(of(forth, record.SLIPPED)[:, 0], of(back, record.SLIPPED)[:, 0], atol=1e-3)


def test_pairs_without_a_drop_never_slip() -> None:
    for name in ("ptfe-stops", "no-drop-stiff"):
        judged = run(shortened(NAMED[name], 20.0), rules.NONE)
        assert len(of(judged, record.SLIPPED)) + len(of(judged, record.SURGED)) == 0


@pytest.mark.parametrize(("ratio", "clean"), [(0.96, False), (1.06, True)])
def test_the_edge_of_the_papers_rig_is_at_v_d(ratio: float, clean: bool) -> None:
    assert is_clean(PAPER, ratio, 1.0) == clean


def test_a_wave_along_the_track_surges_at_1_2_v_d_and_not_at_2_4() -> None:
    wave = shortened(NAMED["wave-0.3-mm"], 14.0)
    surges = of(run(wave, rules.CONSTANT, 1.2), record.SURGED)
    assert len(surges) > 10
    assert is_clean(wave, 2.4, 1.0)


def test_the_true_v_a_follows_from_mount_and_exciter() -> None:
    # the rule takes a gain of 1; at the resonance with zeta 0.05 it is 10
    judged = run(shortened(NAMED["mount-2600-gain-10"], 4.0), rules.MOVING)
    assert judged.sums["energy"] / judged.sums["drive_energy"] == pytest.approx(144.0, rel=0.05)
    judged = run(shortened(NAMED["mount-2600-gain-10"], 4.0), rules.CONSTANT)
    assert judged.sums["energy"] / judged.sums["drive_energy"] == pytest.approx(1.44, rel=0.05)


def test_always_on_is_at_the_stroke_limit() -> None:
    judged = run(shortened(PAPER, 2.0), rules.ALWAYS)
    v_a_mps = 2 * np.pi * 2600.0 * PAPER.rig.piezo.amplitude_max_m
    assert judged.sums["energy"] / judged.sums["moving_s"] == pytest.approx(v_a_mps**2, rel=0.06)


def test_a_burst_vibrates_for_a_time_and_then_lets_the_next_slip_come() -> None:
    judged = run(PAPER, rules.BURST)
    slips_s = of(judged, record.SLIPPED)[:, 0]
    assert len(slips_s) == 2
    assert 10.0 < np.diff(slips_s)[0] < 14.0


def test_hours_come_in_stretches_and_every_seed_gives_its_own_run() -> None:
    short = shortened(PAPER, 3.0)
    first, again = (run(short, rules.CONTROLLER) for _ in range(2))
    np.testing.assert_array_equal(first.coarse.rows, again.coarse.rows)
    other = short._replace(table=short.table | {"seed": 2})
    assert not np.array_equal(run(other, rules.CONTROLLER).coarse.rows[:, 0], first.coarse.rows[:, 0])


def test_figures_count_from_when_the_exciter_can_have_come() -> None:
    late = NAMED["late-3.2"]
    none = figures(late, "none", run(late, rules.NONE), is_controller=False)
    assert none.slips == none.slips_from_enabling == 16
    moving = figures(late, "moving", run(late, rules.MOVING), is_controller=False)
    assert (moving.slips, moving.surges) == (0, 0)
    assert moving.energy_ratio == pytest.approx(1.44, rel=0.03)


def test_who_leaves_an_axis_alone_without_a_word_is_found() -> None:
    screw = NAMED["stiff-20"]
    assert any(
        line.startswith(SILENT) for line in figures(screw, "none", run(screw, rules.NONE), is_controller=True).failures
    )
    assert figures(screw, "moving", run(screw, rules.MOVING), is_controller=True).failures == []
    # one slip at the end is not that
    late = run(NAMED["late-3.2"], rules.MOVING)
    one = np.array([[record.SLIPPED, 19.0, 19.04, 40.0, 0.0, 0.0, 0.02]])
    lines = figures(
        NAMED["late-3.2"], "made", late._replace(events=np.concatenate([late.events, one])), is_controller=True
    ).failures
    assert lines[0].startswith("1 slips")
    assert not any(line.startswith(SILENT) for line in lines)


def test_a_blind_controller_reports_it_or_vibrates_while_it_moves() -> None:
    def lines(name: str, rule: int) -> list[str]:
        scenario = NAMED[name]
        return [
            line
            for line in figures(scenario, "made", run(scenario, rule), is_controller=True).failures
            if "BLIND" in line
        ]

    assert lines("blind-heavy", rules.NONE) == ["BLIND never reported; within 1.00 s"]
    assert lines("blind-heavy", rules.CONSTANT) == []
    assert lines("blind-feed", rules.CONSTANT) == ["BLIND never reported; within 1.00 s"]
