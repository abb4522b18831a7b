"""The whole diagnosis on evidence made from the plant, through the command and from code."""

import json
import shutil

import numpy as np
import pytest
from typer.testing import CliRunner

import diagnosis.diagnose
from cockpit.cli import app
from cockpit.run.scenario import load_rig
from diagnosis.deadline import EndedError
from diagnosis.evidence.folder import load_evidence
from diagnosis.gap.problem import Problem
from diagnosis.hypotheses.catalogue import trials
from diagnosis.judge import witnesses
from diagnosis.report.page import report_page
from diagnosis.synthetic.folder import Case
from diagnosis.synthetic.runs import RunPlan
from plant.effects.library import EFFECTS
from tests.made_evidence import made_evidence

pytestmark = pytest.mark.slow

# a tenth of the work of the whole protocol
SHORT = (
    RunPlan(((0.0, 0.002),), duration_s=5.0),
    RunPlan(((0.0, 0.001),), duration_s=6.0, track=1),
    RunPlan(((0.0, 0.0015),), duration_s=5.0, holdout=True, track=2),
)


def quiet(_text: str, _share: float) -> None:
    pass


@pytest.fixture(scope="module")
def damped():
    """A drive that damps by 12 N s/m, everything else within its tolerances."""
    return made_evidence(Case(SHORT, {"drive-damping": {"damping_Ns_per_m": 12.0}}), seed=21)


@pytest.fixture(scope="module")
def command(damped, tmp_path_factory):
    out = tmp_path_factory.mktemp("said")
    result = CliRunner().invoke(
        app,
        ["diagnose", str(damped), "--json", str(out / "d.json"), "--report", str(out / "d.html"),
         "--apply", str(out / "rig.toml"), "--jobs", "2"],
    )  # fmt: skip
    assert result.exit_code == 0, result.output
    return result.output, json.loads((out / "d.json").read_text()), out


def test_the_command_names_the_effect_in_the_form_of_the_contract(command):
    printed, result, _ = command
    assert result["format"] == "diagnosis/3"
    assert result["verdict"] == "effect"
    assert result["effects"] == ["drive-damping"]
    names = {candidate["effect"] for candidate in result["candidates"]}
    assert names == {*EFFECTS, "none"}
    assert result["complete"] > 0.9
    assert sum(candidate["probability"] for candidate in result["candidates"]) == pytest.approx(1.0)
    best = result["candidates"][0]
    low, high = best["parameters"]["damping_Ns_per_m"]["interval_90"]
    assert low < best["parameters"]["damping_Ns_per_m"]["value"] < high
    assert best["parameters"]["damping_Ns_per_m"]["value"] == pytest.approx(12.0, rel=0.25)
    assert sum(cell["share"] for cell in result["where"]) == pytest.approx(1.0)
    assert {cell["regime"] for cell in result["where"]} <= {"stick", "breakaway", "slip", "restick", "steady"}
    assert "drive-damping" in printed


def test_the_gap_is_judged_on_the_held_out_run_only(command):
    _, result, _ = command
    gap = result["gap"]
    assert gap["runs"] == ["run-03"]
    assert gap["with_effect"] < gap["retuned"] < gap["nominal"]
    closed = (gap["retuned"] - gap["with_effect"]) / (gap["retuned"] - gap["floor"])
    if gap["shrinkage"] is not None:
        assert gap["shrinkage"] == pytest.approx(closed)
    assert [fit["who"] for fit in gap["compared"]][-1] == "parameters alone"


def test_the_report_and_the_rig_file_are_there(command):
    _, _, out = command
    page = (out / "d.html").read_text()
    assert len(page) < 5e6
    assert "drive-damping" in page
    assert "drive-damping" in load_rig(str(out / "rig.toml"), []).effects


def diagnosed(folder, jobs: int):
    """With few effects tried."""
    wanted = {"drive-damping", "viscous-friction", "static-level"}

    def few(problem: Problem):
        return [trial for trial in trials(problem) if set(trial.hypothesis.effects) <= wanted]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(witnesses, "trials", few)
        return diagnosis.diagnose.diagnose(load_evidence(folder), quiet, jobs)


@pytest.fixture(scope="module")
def one(damped):
    return diagnosed(damped, 2)


@pytest.mark.nightly  # 37 s of CPU
def test_nothing_leaks_from_the_held_out_run(damped, one, tmp_path):
    """A held-out run of another rig changes no digit of the fits."""
    other = tmp_path / "other"
    shutil.copytree(damped, other)
    shutil.copy(made_evidence(Case(SHORT), seed=99) / "run-03.parquet", other / "run-03.parquet")
    two = diagnosed(other, 2)
    assert one.effects == ("drive-damping",)
    own_fits, other_fits = (
        {fit.effect: (fit.chi2, fit.form, fit.parameters) for fit in result.candidates} for result in (one, two)
    )
    assert own_fits == other_fits
    assert one.gap.retuned != two.gap.retuned
    assert (one.verdict, two.verdict) == ("effect", "partly")
    assert two.complete < one.complete  # 0.909 and 0.923: the verdict shows the other rig, the probability barely


@pytest.mark.nightly
def test_the_number_of_processes_changes_not_a_digit(damped, one):
    two = diagnosed(damped, 1)
    assert one._replace(elapsed_s=0.0, pictures=()) == two._replace(elapsed_s=0.0, pictures=())


@pytest.mark.nightly
def test_force_alone_gives_an_answer_that_is_not_confidently_wrong():
    missing = ("mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m")
    case = Case(SHORT, {"drive-damping": {"damping_Ns_per_m": 12.0}}, leave_out=missing)
    result = diagnosis.diagnose.diagnose(load_evidence(made_evidence(case, seed=22)), quiet, jobs=2)
    best = result.candidates[0]
    group = {*result.effects, *(name for names in result.not_distinguishable for name in names)}
    assert "drive-damping" in group or best.effect == "none" or result.complete * best.probability < 0.9
    assert any("mass_accel_mps2" in finding.where for finding in result.findings)
    assert np.isfinite(result.gap.retuned)


@pytest.mark.parametrize(
    ("stage", "answer"),
    [
        ("prepare", ("not-finished", ())),
        ("relations_of", ("not-finished", ())),
        ("baseline_of", ("partly", ("drive-damping",))),  # the spring relation names it
    ],
)
def test_an_end_at_any_stage_gives_a_valid_answer(stage, answer, damped, monkeypatch):
    def ended(*_: object) -> None:
        raise EndedError

    monkeypatch.setattr(witnesses, stage, ended)
    result = diagnosis.diagnose.diagnose(load_evidence(damped), quiet)
    assert (result.verdict, result.effects) == answer
    probabilities = [row.probability for row in result.candidates]
    if result.verdict == "not-finished":
        assert np.isnan([result.complete, *probabilities]).all()
    else:
        assert sum(probabilities) == pytest.approx(1.0)
    assert len(result.summary) == 6
    assert result.gap.files == ("run-03.parquet",)
    assert f'class="verdict {result.verdict}"' in report_page(result, "rig")
