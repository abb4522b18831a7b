"""The fixture `rig` of pytest: runs, expectations, logs of a failed test, properties, and its cost for other tests."""

import subprocess
import sys
from pathlib import Path
from xml.etree import ElementTree as Xml

import pytest

from bridge.faults import Fault
from cockpit.expect.tables import ExpectTable
from cockpit.run.scenario_file import as_settings
from cockpit.testing.api import Expectation
from cockpit.testing.plugin import MakeRig

CONTROLLED = {"controller": {"policy": {"enabled_from_s": 0.0}}}
FAILING = """
import pytest

@pytest.mark.requirement("R-2")
def test_fails(rig):
    run = rig("paper-c45-c45", controller={"policy": {"enabled_from_s": 0.0}}).run(0.3)
    run.expect(signal="amplitude_m", at_most="28 nm", requirement="R-1")
    run.expect(signal="amplitude_m", at_most="1 nm", from_s=0.2)
"""


@pytest.mark.slow
def test_a_run_has_signals_events_and_expectations(rig: MakeRig) -> None:
    axis = rig("paper-c45-c45", seed=3, **CONTROLLED)
    axis.fault("killed", "controller", from_s=0.5)
    run = axis.run(0.8)
    run.expect(event=["COMMAND_LOST", "FALLBACK"], from_s=0.5, within_s=0.2)
    assert run["amplitude_m"].max() < 30e-9
    assert run["amplitude_m"].shape == run.t_s("amplitude_m").shape
    assert run.events["FALLBACK"][0] > 0.5
    with pytest.raises(AssertionError, match=r"FAILED   amplitude_m at most 1 nm: .* nm at 0.\d+ s"):
        run.expect(signal="amplitude_m", at_most="1 nm", from_s=0.2)
    with pytest.raises(AssertionError, match="UNTESTED time_to_slip_s"):
        run.expect(signal="time_to_slip_s", at_least=1.0)
    with pytest.raises(Fault, match="perhaps amplitude_m"):
        run["amplitude"]
    with pytest.raises(Fault, match="from_s = 2: must not be after the end of the run"):
        run.expect(slips=0, from_s=2.0)


def test_steps_and_the_expectations_of_a_scenario_next_to_the_test(rig: MakeRig, tmp_path: Path) -> None:
    scenario = tmp_path / "mine.toml"
    scenario.write_text(
        'duration_s = 0.5\narm = true\nrig = { file = "paper-c45-c45" }\nstep = [{ at_s = 0.2, speed_mps = 0.001 }]\n'
        '[[expect]]\nsignal = "drive_velocity_mps"\nat_least = "0.9 mm/s"\nfrom_s = 0.3\nto_s = 0.4\n'
    )
    axis = rig(str(scenario))
    axis.run().expect()
    axis.step(0.4, command="STOP")
    run = axis.run()
    run.expect()
    run.expect(state="guard", is_in="FAULT", from_s=0.41)


@pytest.mark.slow
def test_a_failed_test_keeps_its_log_and_names_the_replay(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "test_mine.py").write_text(FAILING)
    monkeypatch.chdir(tmp_path)
    words = ["-p", "no:cacheprovider", "--rootdir", str(tmp_path), "-c", "/dev/null", "--junitxml", "r.xml"]
    assert pytest.main([*words, "-o", "junit_logging=all", "test_mine.py"]) == 1
    log = Path("runs/tests/test_mine.py-test_fails.mcap")
    assert log.is_file()
    svg = log.with_suffix(".svg").read_text()
    assert len(svg) < 10_000
    assert 'stroke-dasharray="6 3"/><path d="M' in svg  # the limit, then the instant
    assert "amplitude_m at most 1 nm: FAILED at 0.2" in svg
    case = Xml.parse("r.xml").getroot().find(".//testcase")  # noqa: S314
    assert case is not None
    properties = [(row.get("name"), row.get("value")) for row in case.iterfind("properties/*")]
    assert [value for name, value in properties if name == "requirement"] == ["R-2", "R-1"]
    assert dict(properties)["log"] == str(log)
    assert dict(properties)["rig"] == "paper-c45-c45"
    assert len(dict(properties)["checksum"] or "") == 64


@pytest.mark.slow
def test_a_quarantined_rig_is_reported_in_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "test_quarantined.py").write_text(
        "from bridge.faults import Fault\ndef test_quarantined(rig):\n    raise Fault('QUARANTINED', 'axis: look at it')\n"
    )
    monkeypatch.chdir(tmp_path)
    assert (
        pytest.main(
            ["-q", "-p", "no:cacheprovider", "--rootdir", str(tmp_path), "-c", "/dev/null", "test_quarantined.py"]
        )
        == 1
    )
    out = capsys.readouterr().out
    assert "QUARANTINED: axis: look at it" in out
    assert "raise Fault" not in out


def test_the_keys_of_an_expectation_are_those_of_its_table() -> None:
    assert set(Expectation.__annotations__) == set(ExpectTable.model_fields)


def test_tables_become_settings() -> None:
    given = {"seed": 3, "rig": {"file": "a"}, "fault": [{"kind": "dead"}], "arm": True}
    assert as_settings(given) == ["seed=3", 'rig.file="a"', 'fault=[{kind = "dead"}]', "arm=true"]


@pytest.mark.slow
def test_the_plug_in_imports_nothing_heavy(tmp_path: Path) -> None:
    """Other test runs pay for the package and this module alone."""
    (tmp_path / "test_other.py").write_text(
        "import sys\ndef test_other():\n    assert not {'numpy', 'bridge'} & {*sys.modules}\n"
    )
    words = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "-c", "/dev/null", "test_other.py"]
    done = subprocess.run(words, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
