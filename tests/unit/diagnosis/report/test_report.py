"""The report of a diagnosis: the answer first, nothing from outside, small, and nothing that a diagnosis holds breaks it."""

import math
import re

import numpy as np
import pytest

from bridge import units
from bridge.log.finding import Finding
from bridge.results import strict_json
from cockpit.commands import diagnose_output
from diagnosis.evidence.foreign_vibration import DISTORTED, PICK_UP
from diagnosis.judge.judge import Judged
from diagnosis.report import assemble
from diagnosis.report import words as in_words
from diagnosis.report.page import report_page, rig_row, where_map, write_report
from diagnosis.report.summary import summary
from diagnosis.result import Candidate, Cell, Curve, Diagnosis, Estimate, Picture, RigNumber, Shrinkage
from tests import made_up

NAN = math.nan


def page_of(diagnosis: Diagnosis, tmp_path, name: str = "rig-07") -> str:
    path = tmp_path / "report.html"
    write_report(diagnosis, name, path)
    assert [file.name for file in tmp_path.iterdir()] == ["report.html"]
    return path.read_text(encoding="utf-8")


def text_of(page: str) -> str:
    body = re.sub(r"<[^>]*>", " ", page.split("<body>")[1])
    return re.sub(r"\s+", " ", body)


@pytest.mark.slow
def test_the_answer_comes_first_and_everything_is_there_in_order(tmp_path):
    text = text_of(page_of(made_up.diagnosis(), tmp_path))
    assert text.index("drive-backlash, probability 95 %") < 150
    parts = [
        "98 % that nothing else acts",
        "46 mN remain in the spring relation over the extension, where noise is 12 mN: nothing in the library",
        "Pictures",
        "Third cycle of run-04",
        "Which explanation?",
        "Probability that nothing else acts: 98 %",
        "gap 81 µm (90 %: 76 to 86)",
        "Below 1.5 % each: force-sensor-lag",
        "These runs cannot separate: force-sensor-delay, drive-damping",
        "How far is the model off?",
        "closes 98 % of the gap that the baseline leaves open (90 %: 95 % to 100 %)",
        "What do the relations between the channels show?",
        "spring relation: 0.8 N as described, 0.3 N refitted, noise 12 mN",
        "drive-backlash 73 % 61 % to 92 % 12 %",
        "46 mN remain in the spring relation over the extension, where noise is 12 mN: nothing in the library",
        "base: left out: run-01.parquet has no base_accel_mps2",
        "Where does the difference lie?",
        "drive force stick",
        "mass acceleration stick",
        "above 200 Hz",
        "The rig's numbers",
        "drive stiffness 11.7 kN/m 11.01 kN/m ± 2 % -2.9",
        "contact stiffness 77.52 MN/m 77.52 MN/m known exactly",
        "What to measure next",
        "Reverse the drive",
        "differ by 4.2 standard deviations",
        "Faults and gaps in the data",
        "12 samples at 20 N were left out",
        "Words",
    ]
    place = 0
    for part in parts:
        place = text.index(part, place)
    assert "retuned" not in text
    assert "parameters alone" not in text


@pytest.mark.slow
def test_twenty_pictures_stay_small_and_nothing_comes_from_outside(tmp_path):
    pictures = tuple(made_up.picture("residual" if seed % 2 else "cycle", 2000, seed) for seed in range(20))
    page = page_of(made_up.diagnosis()._replace(pictures=pictures), tmp_path)
    assert len(page.encode()) < 5e6
    assert page.count("data:image/png;base64,") == 20
    assert not re.search(r"https?://|<link|<script|@import|url\(", page)
    assert all(source.startswith("data:image/png;base64,") for source in re.findall(r'src="([^"]{0,30})', page))


@pytest.mark.slow
def test_too_many_pictures_are_drawn_coarser(tmp_path, monkeypatch):
    monkeypatch.setattr("diagnosis.report.page_plots._ALL_BYTES", 60_000)
    pictures = tuple(made_up.picture("residual", 2000, seed) for seed in range(4))
    page = page_of(made_up.diagnosis()._replace(pictures=pictures), tmp_path)
    assert page.count("data:image/png;base64,") == 4
    assert len(page) < 100_000


def test_text_is_text(tmp_path):
    nasty = "<script>alert('&')</script> $x_1$ {{ 1 }}"
    made = made_up.diagnosis()
    curve = Curve(nasty, np.array([0.0, 1.0]), np.array([0.0, 1.0]), "effect")
    made = made._replace(
        summary=(nasty,),
        candidates=(Candidate(nasty, 0.5, nasty, {nasty: Estimate(1.0, (0.0, 2.0))}),),
        not_distinguishable=((nasty, nasty),),
        where=(Cell(nasty, nasty, (0.0, 1.0), nasty, 1.0),),
        gap=made.gap._replace(definition=nasty, files=(nasty,), compared=(Shrinkage(nasty, 1.0, 0.0, None),)),
        pictures=(Picture("residual", nasty, nasty, nasty, (curve,)),),
        findings=(made.findings[0]._replace(kind=nasty, where=nasty, text=nasty),),
    )
    page = page_of(made, tmp_path, nasty)
    assert "<script" not in page
    assert "{{ 1 }}" in page


@pytest.mark.parametrize("verdict", ["no-gap", "unexplained"])
def test_a_diagnosis_with_nothing_in_it(verdict, tmp_path):
    made = made_up.diagnosis()
    empty = made._replace(
        verdict=verdict,
        effects=(),
        summary=(),
        candidates=(),
        not_distinguishable=(),
        where=(),
        gap=made.gap._replace(files=(), shrinkage=None, interval_90=None, compared=()),
        next_experiment=made.next_experiment._replace(gain=None),
        rig=(),
        findings=(),
        pictures=(),
    )
    page = page_of(empty, tmp_path)
    assert f'class="verdict {verdict}"' in page
    assert "with the best explanation" not in page
    assert "No place stands out." in page
    assert "base64" not in page


def test_numbers_that_are_not_finite_are_shown_as_unknown(tmp_path):
    made = made_up.diagnosis()
    hole = Curve("hole", np.array([0.0, 1.0, 2.0]), np.array([NAN, math.inf, 1.0]), "measured")
    nothing = Curve("nothing", np.array([]), np.array([]), "points")
    broken = made._replace(
        candidates=(
            Candidate("drive-backlash", NAN, "", {"gap_m": Estimate(NAN, (NAN, math.inf))}),
            Candidate("none", 0.0),
        ),
        where=(Cell("drive_force_N", "slip", (0.0, math.inf), "run-01", NAN), Cell("x", "new", (0.0, 1.0), "r", 0.4)),
        gap=made.gap._replace(nominal=NAN, retuned=math.inf, with_effect=-1.0, floor=NAN, interval_90=(NAN, NAN)),
        next_experiment=made.next_experiment._replace(gain=NAN),
        rig=(RigNumber("mass_kg", NAN, math.inf, 0.1), RigNumber("drive_damping_Ns_per_m", 0.0, 1.0, 0.1)),
        pictures=(Picture("cycle", "", "", "", (hole, nothing)), Picture("residual", "", "", "", ())),
        elapsed_s=NAN,
    )
    page = page_of(broken, tmp_path)
    assert "unknown" in page
    assert "width: nan" not in page


@pytest.mark.slow
def test_without_a_held_out_run_the_report_gives_advice_in_place_of_the_chart(tmp_path):
    made = made_up.diagnosis()
    alone = made.gap._replace(files=(), nominal=NAN, retuned=NAN, with_effect=NAN, floor=NAN, compared=())
    page = page_of(made._replace(gap=alone), tmp_path)
    assert "Add a second run" in page
    assert "how much of that drive-backlash closes" in page
    assert "with the best explanation" not in page
    assert "unknown" not in page.split("<h2>How far")[1].split("<h2>")[0]


def test_the_map_keeps_the_order_of_a_cycle_and_counts_the_share_left_out():
    cells = tuple(
        Cell("drive_force_N", regime, (0.0, 20.0), run, share)
        for regime, run, share in (
            ("steady", "b", 0.5),
            ("stick", "a", 0.3),
            ("slip", "b", 0.196),
            ("restick", "a", 0.004),
        )
    )
    runs, rows, left_out = where_map(cells)
    assert runs == ["a", "b"]
    assert [(row.regime, row.shares) for row in rows] == [
        ("stick", [0.3, None]),
        ("slip", [None, 0.196]),
        ("steady", [None, 0.5]),
    ]
    assert left_out == pytest.approx(0.004)


def by_label(diagnosis: Diagnosis) -> dict[str, str]:
    """The six lines of the answer by their labels; the first one as `answer`."""
    answer, *lines = summary(diagnosis)
    assert len(lines) == 5
    return {"answer": answer} | {text[:10].rstrip(): text[11:] for text in lines}


def test_the_answer_has_six_lines_and_the_named_effects_first():
    made = made_up.diagnosis()
    assert summary(made) == made.summary
    pair = made._replace(effects=("drive-backlash", "drive-hardening"))
    assert "drive-backlash and drive-hardening, probability 98 %: gap 81 µm" in by_label(pair)["answer"]


STIFFNESS = "drive stiffness 11.01 kN/m (90 %: 10.95 to 11.07), described 11.7 kN/m (2.9 tolerances off)"


@pytest.mark.parametrize(
    ("verdict", "answer", "sure", "numbers"),
    [
        (
            "described",
            f"described: {STIFFNESS}, closes 43 % of",
            "98 % that nothing else acts",
            "every other described",
        ),
        (
            "unexplained",
            "no known effect accounts for it",
            "the held-out runs are 5.9 noise floors off, more",
            STIFFNESS,
        ),
        ("no-gap", "the described rig explains these runs", "98 % that nothing else acts; leading", STIFFNESS),
        ("not-finished", "the work ended before any cause was tried", "nothing was judged", STIFFNESS),
    ],
)
def test_every_verdict_without_an_effect_has_its_words(verdict, answer, sure, numbers):
    made = made_up.diagnosis()
    gap = made.gap._replace(with_effect=5.9, shrinkage=None, interval_90=None)
    lines = by_label(made._replace(verdict=verdict, effects=(), gap=gap))
    assert answer in lines["answer"]
    assert lines["sure"].startswith(sure)
    assert lines["numbers"].startswith(numbers)
    assert lines["held out"] == "run-04.parquet: 6.2 noise floors as described, 5.9 refitted (perfect: 1)"


def test_an_answer_that_was_cut_short_claims_nothing_about_the_rest():
    made = made_up.diagnosis()
    gap = made.gap._replace(with_effect=5.9, shrinkage=None, interval_90=None)
    cut = Finding("budget", "fits", "ended before every effect was tried")
    lines = by_label(made._replace(verdict="partly", gap=gap, findings=(cut,)))
    assert lines["sure"].startswith("the time ended before everything was tried")
    assert "nothing else acts" not in " ".join(lines.values())
    assert "something else acts" not in " ".join(lines.values())
    assert "no gap is left" not in lines["held out"]


def test_a_number_that_no_effect_stands_for_has_no_rival_candidates():
    made = made_up.diagnosis()._replace(verdict="described", effects=("static-level",), not_distinguishable=())
    assert by_label(made)["sure"] == "98 % that nothing else acts"
    level = (Candidate("static-level", 0.9), Candidate("none", 0.1))
    assert by_label(made._replace(candidates=level))["sure"].startswith(
        "static-level 90 %; 98 % that nothing else acts; other"
    )


def test_a_wrong_number_that_no_candidate_names_has_no_group():
    """Its probability is that of an idle effect, so all idle effects would be its rivals."""
    chances = {"none": 0.8, "frictional-lag": 0.1, "stribeck-velocity": 0.1}
    judged = Judged(chances, {frozenset(): 0.8, frozenset({"frictional-lag"}): 0.1}, 0.9)
    assert assemble._alike(judged, ("stribeck-velocity",)) == ()
    assert assemble._alike(
        judged._replace(explanations={frozenset({"stribeck-velocity"}): 0.1}), ("stribeck-velocity",)
    ) == (("stribeck-velocity", "frictional-lag"),)


def test_without_a_fit_no_number_was_refitted():
    lines = by_label(made_up.diagnosis()._replace(verdict="partly", rig=(), numbers=()))
    assert lines["numbers"] == "none was refitted"


def test_the_summary_agrees_with_the_held_out_runs():
    made = made_up.diagnosis()
    worse = made._replace(gap=made.gap._replace(retuned=2.9, with_effect=3.6, shrinkage=-0.37))
    assert "the gap grows from 2.9 to 3.6 noise floors" in by_label(worse)["held out"]
    refit_worse = made._replace(gap=made.gap._replace(retuned=7.9))
    assert (
        by_label(refit_worse)["numbers"] == "the refitted numbers make the held-out runs worse: keep the described ones"
    )
    assert units.percent(-0.003) == "0 %"


@pytest.mark.parametrize(("retuned", "expected"), [(0.97, True), (1.3, False)])
def test_a_gap_that_the_held_out_runs_do_not_show_is_ascribed_to_the_fitted_runs(retuned, expected):
    made = made_up.diagnosis()
    gap = made.gap._replace(retuned=retuned, shrinkage=None)
    lines = by_label(made._replace(verdict="unexplained", effects=(), gap=gap))
    assert ("the gap shows in the fitted runs alone" in lines["held out"]) is expected


@pytest.mark.parametrize(
    ("left", "effects", "expected"),
    [(2.2, ("drive-backlash",), False), (5.54, ("drive-backlash",), True), (5.54, (), False)],
)
def test_the_summary_warns_where_a_name_leaves_more_than_a_right_name(left, effects, expected):
    made = made_up.diagnosis()
    verdict = "effect" if effects else "unexplained"
    gap = made.gap._replace(retuned=6.51, with_effect=left)
    lines = by_label(made._replace(verdict=verdict, effects=effects, gap=gap))
    assert ("leaves about 1 on the held-out runs, not 5.5" in lines["else"]) is expected


@pytest.mark.slow
def test_a_share_that_is_not_above_chance_has_no_bar(tmp_path):
    made = made_up.diagnosis()
    by_chance = made.shares[0]._replace(what="rough track", share=0.999, null_90=1.0)
    page = page_of(made._replace(shares=(by_chance, *made.shares)), tmp_path)
    assert '<i class="rough track"' not in page
    assert '<i class="drive-backlash" style="width: 73.0%"' in page
    assert not any("rough track" in row for row in in_words.relation_lines(made._replace(shares=(by_chance,))))


def test_runs_of_two_folders_keep_their_names_apart():
    made = made_up.diagnosis()
    cells = [cell._replace(file=run) for cell, run in zip(made.where, ("a/1.csv", "b/1.csv"), strict=False)]
    assert [cell["run"] for cell in strict_json(made._replace(where=tuple(cells)))["where"]] == ["a/1", "b/1"]


def test_runs_in_which_nothing_moves_are_in_the_summary():
    findings = tuple(Finding("still", f"run-0{i}.csv: drive_position_m", "0 m in all") for i in (1, 3))
    lines = by_label(made_up.diagnosis()._replace(verdict="no-gap", effects=(), findings=findings))
    assert "in run-01.csv, run-03.csv the drive does not move: friction and drive are not tested there" in lines["else"]


@pytest.mark.parametrize("kind", ["wrong-unit", "sign"])
def test_a_wrong_unit_or_sign_comes_before_the_answer(kind):
    text = "largest value 1.2e+04 N, 828 times rig.static_force_N = 14.49: the unit cannot be right; not used"
    wrong = tuple(Finding(kind, f"run-0{number}.csv: drive_force_N", text) for number in (1, 2))
    lines = by_label(made_up.diagnosis()._replace(findings=wrong))
    assert lines["answer"].startswith("doubtful, first correct the unit or sign of drive_force_N: effect: ")
    assert lines["else"].startswith(f"drive_force_N: {text};")
    assert lines["else"].count("largest value") == 1


def test_vibrations_that_no_model_has_are_in_the_summary_with_their_runs():
    picked_up = tuple(Finding(PICK_UP, f"run-0{i}.csv: drive_force_N", "vibrates with 0.3 N") for i in (1, 2, 4))
    findings = (*picked_up[:2], Finding(DISTORTED, "run-02.csv: base_accel_mps2", "moves at 5000 Hz"), picked_up[2])
    lines = by_label(made_up.diagnosis()._replace(findings=findings))
    assert "run-01.csv: drive_force_N vibrates with 0.3 N, also run-02.csv, run-04.csv" in lines["else"]
    assert "run-02.csv: base_accel_mps2 moves at 5000 Hz" in lines["else"]


@pytest.mark.parametrize(
    ("name", "estimate", "words"),
    [
        ("gap_m", Estimate(8.1e-5, (7.6e-5, 8.6e-5)), "gap 81 µm (90 %: 76 to 86)"),
        ("delay_s", Estimate(1.04e-3, (1.01e-3, 1.07e-3)), "delay 1.040 ms (90 %: 1.010 to 1.070)"),
        ("ratio", Estimate(0.052, (0.048, 0.056)), "relative change 5.20 % (90 %: 4.80 to 5.60)"),
        ("ratio", Estimate(-0.2, (-0.25, -0.15)), "relative change -20 % (90 %: -25 to -15), a softening"),
        ("coulomb_force_N", Estimate(14.0, (13.0, 15.0)), "Coulomb force 14.0 N (90 %: 13.0 to 15.0)"),
        ("stribeck_velocity_mps", Estimate(5e-4, (NAN, NAN)), "Stribeck velocity 500 µm/s"),
        ("damping_Ns2_per_m2", Estimate(210.0, (NAN, NAN)), "damping 210 N s²/m²"),
        ("rate_per_s", Estimate(0.002, (0.001, 0.003)), "rate 0.0020 1/s (90 %: 0.0010 to 0.0030)"),
        ("compliance_m_per_N", Estimate(1e-6, (NAN, NAN)), "compliance 1 µm/N"),
        ("exponent", Estimate(0.3, (0.3, 0.3)), "exponent 0.3 (90 %: 0.3 to 0.3)"),
        ("corner_Hz", Estimate(3000.0, (2900.0, 3100.0)), "corner 3.00 kHz (90 %: 2.90 to 3.10)"),
    ],
)
def test_an_estimate_in_words(name, estimate, words):
    assert in_words.estimate_in_words("drive-hardening", name, estimate) == words


def test_a_nearly_certain_share_is_not_rounded_to_certainty():
    assert [units.percent(share) for share in (0.0, 1e-4, 0.004, 0.93, 0.996, 0.9999, 1.0, NAN, None)] == [
        "0 %",
        "< 0.1 %",
        "0.4 %",
        "93 %",
        "99.6 %",
        "> 99.9 %",
        "100 %",
        "unknown",
        "unknown",
    ]


def test_a_number_known_exactly_has_not_moved():
    assert rig_row(RigNumber("mass_kg", 1.5, 1.5, 0.0)).shift_sd is None
    assert rig_row(RigNumber("mass_kg", 1.5, 1.53, 0.01)).shift_sd == pytest.approx(2.0)
    tail = rig_row(RigNumber("stribeck_tail", 0.0, -0.12, 0.4))
    assert tail.tolerance == "± 0.4"
    assert tail.shift_sd == pytest.approx(-0.3)


@pytest.mark.slow
def test_the_summary_warns_where_the_held_out_runs_do_not_test_the_name(tmp_path):
    made = made_up.diagnosis()
    untested = made._replace(gap=made.gap._replace(retuned=1.0, with_effect=1.0, shrinkage=None, interval_90=None))
    assert "no gap is left to close there, so new data have not tested the name" in by_label(untested)["held out"]
    page = text_of(page_of(untested, tmp_path))
    assert "There is no gap to close on these runs: they do not test the named effect." in page
    assert "Nothing is named" not in page


@pytest.mark.slow
def test_the_text_closes_at_most_the_whole_gap_and_the_json_has_the_number():
    made = made_up.diagnosis()
    compared = tuple(fit._replace(shrinkage=1.06, interval_90=(0.43, 1.76)) for fit in made.gap.compared)
    gap = made.gap._replace(shrinkage=1.06, interval_90=(0.43, 1.76), compared=compared)
    made = made._replace(gap=gap)
    assert "100 % of it closed (90 %: 43 % to 100 %)" in by_label(made)["held out"]
    page = report_page(made, "rig")
    for text in (page, "\n".join(summary(made)), "\n".join(diagnose_output.details(made))):
        assert "106 %" not in text
        assert "176 %" not in text
        assert "100 %" in text
    assert strict_json(made)["gap"]["shrinkage"] == 1.06
    assert strict_json(made)["gap"]["interval_90"] == [0.43, 1.76]
