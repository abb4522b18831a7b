"""A diagnosis as a rig file, and a run on it."""

import json
import tomllib

import pytest
from typer.testing import CliRunner

from bridge.faults import Fault
from cockpit.cli import app
from cockpit.run.scenario import load_rig
from diagnosis.evidence.folder import load_evidence
from diagnosis.report.rig_file import write_rig
from diagnosis.result import Candidate, Estimate
from tests import made_up

ROLL_OFF = Candidate("piezo-roll-off", 0.6, "first-order", {"corner_Hz": Estimate(2500.0, (2300.0, 2700.0))})
AGEING = Candidate("static-friction-ageing", 0.4, "log", {"ratio": Estimate(0.03, (0.02, 0.04))})


@pytest.fixture
def evidence(tmp_path):
    return load_evidence(made_up.evidence_folder(tmp_path / "bench"))


def test_the_file_holds_the_refitted_rig_and_the_effect(evidence, tmp_path):
    path = tmp_path / "out" / "rig.toml"
    write_rig(made_up.diagnosis(), evidence, path)
    rig = load_rig(str(path), [])
    assert rig.drive.stiffness_N_per_m == 11012.0
    assert rig.contact.static_force_N == 17.61
    assert rig.contact.stribeck_tail == -0.12
    assert rig.contact.coulomb_force_N == 14.49  # known exactly: as described
    assert rig.effects == {"drive-backlash": {"form": "", "gap_m": 8.1e-5}}
    header = path.read_text().split("\nname")[0]
    assert "bench" in header
    assert "drive-backlash, probability 95 %" in header
    assert all(line.startswith("#") for line in header.splitlines())


def test_described_gives_the_numbers_that_were_found_and_no_effect(evidence, tmp_path):
    number = made_up.diagnosis().numbers[0]._replace(found=10500.0)
    described = made_up.diagnosis()._replace(verdict="described", effects=("drive-stiffness",), numbers=(number,))
    write_rig(described, evidence, tmp_path / "rig.toml")
    rig = load_rig(str(tmp_path / "rig.toml"), [])
    assert (rig.drive.stiffness_N_per_m, rig.effects) == (10500.0, {})
    assert "described 11.7 kN/m" in (tmp_path / "rig.toml").read_text()


def test_no_gap_gives_the_retuned_rig(evidence, tmp_path):
    write_rig(made_up.diagnosis()._replace(verdict="no-gap", effects=()), evidence, tmp_path / "rig.toml")
    assert load_rig(str(tmp_path / "rig.toml"), []).effects == {}
    assert "effects" not in tomllib.loads((tmp_path / "rig.toml").read_text())


def test_a_verdict_without_a_rig_is_refused_and_nothing_is_written(evidence, tmp_path):
    path = tmp_path / "rig.toml"
    with pytest.raises(Fault, match="unexplained"):
        write_rig(made_up.diagnosis()._replace(verdict="unexplained", effects=()), evidence, path)
    rig = evidence.rig.model_copy(update={"drive": "force"})
    with pytest.raises(Fault, match='drive = "force"'):
        write_rig(made_up.diagnosis(), evidence._replace(rig=rig), path)
    assert not path.exists()


def run(*arguments):
    return CliRunner().invoke(app, ["run", "--in-process", *map(str, arguments)])


@pytest.fixture
def diagnosed(evidence, tmp_path):
    """A rig with a weak piezo and ageing, as a diagnosis would write it."""
    path = tmp_path / "diagnosed.toml"
    diagnosis = made_up.diagnosis()
    effects = (ROLL_OFF.effect, AGEING.effect)
    write_rig(diagnosis._replace(effects=effects, candidates=(ROLL_OFF, AGEING), rig=()), evidence, path)
    return path


SHORT = ("--set", "duration_s=9.0", "--set", "controller.policy.enabled_from_s=4.0")


@pytest.mark.slow
def test_the_loop_holds_on_the_corrected_rig(diagnosed, tmp_path):
    result = run("--rig", diagnosed, *SHORT, "--log", tmp_path / "run.mcap", "--json")
    table = json.loads(result.stdout)
    assert result.exit_code == 0
    assert table["effects"] == ["piezo-roll-off", "static-friction-ageing"]
    assert table["before"]["slips"] > 0
    assert table["after"]["slips"] == 0
    assert table["velocity_ratio_min"] > 1.0


@pytest.mark.slow
def test_a_piezo_that_is_too_weak_is_reported(diagnosed, tmp_path):
    weak = ("--set", "rig.effects.piezo-roll-off.corner_Hz=300.0")
    result = run("--rig", diagnosed, *weak, *SHORT, "--verbose", "--log", tmp_path / "run.mcap")
    assert "with piezo-roll-off, static-friction-ageing" in result.stdout
    assert "EXCITER_END" in result.stdout
    assert "stick-slip may return" in result.stdout or result.exit_code == 1


def test_a_rig_that_is_not_there_is_one_clear_line(tmp_path):
    result = run("--rig", tmp_path / "none.toml")
    assert result.exit_code == 2
    assert "no such file" in result.stderr
