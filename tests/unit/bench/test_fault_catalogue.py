"""The catalogue of faults is sound, and some of it is judged; all of it in the night."""

from pathlib import Path

import pytest

from bench.faults.judge import KNOWN, SAFE, SILENT, UNSAFE, begin_s, judge
from bench.faults.page import page
from bench.faults.run import FaultBench, bench, chosen
from bridge.faults import Fault
from bridge.results import strict_json
from cockpit.faults.catalogue import CatalogueEntry, find_entry, load_catalogue
from cockpit.run.scenario import load_scenario

KILLED = """duration_s = 1.4
arm = true
rig = { file = "paper-c45-c45" }
fault = [{ kind = "killed", target = "controller", from_s = 0.6 }]
"""
REPORTED = 'expect = [{ event = "FALLBACK", from_s = 0.6, within_s = 0.2 }]'
RESTS = 'expect = [{ signal = "amplitude_m", at_most = "0.01 nm", from_s = 0.9 }]'


def quiet(_share: float, _line: str) -> None:
    return


def entry(folder: Path, text: str) -> CatalogueEntry:
    path = folder / "mine.toml"
    path.write_text(text)
    return CatalogueEntry("mine", "processes", "the controller ends at once", str(path))


@pytest.mark.slow
def test_every_case_is_a_scenario_with_a_fault_or_command() -> None:
    catalogue = load_catalogue()
    for row in catalogue:
        made = load_scenario(row.scenario, [])
        assert made.name == row.name
        assert 0.0 <= begin_s(made) < made.duration_s
    assert {row.name for row in catalogue} >= KNOWN.keys()


@pytest.mark.slow
def test_a_dead_controller_is_safe_and_reported_on_the_page(tmp_path: Path) -> None:
    result = bench([entry(tmp_path, KILLED + REPORTED)], 1, quiet)
    (outcome,) = result.outcomes
    assert (outcome.verdict, outcome.expectations[0].value) == (SAFE, "FALLBACK")
    text = page(result)
    assert "| `mine` |" in text
    assert "`FALLBACK` 0.65 s" in text
    assert "**1 safe, 0 SILENT, 0 UNSAFE**" in text
    assert strict_json(result)["counts"] == {SAFE: 1, SILENT: 0, UNSAFE: 0}


@pytest.mark.slow
def test_a_fault_without_its_expected_event_is_silent_and_worse_than_known(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    outcome = judge(entry(tmp_path, KILLED + REPORTED.replace("FALLBACK", "NOISE")))
    assert outcome.verdict == SILENT
    assert "no NOISE" in outcome.why
    assert FaultBench([outcome]).worse == [outcome]
    monkeypatch.setitem(KNOWN, "mine", SILENT)
    assert outcome.as_known


@pytest.mark.slow
def test_a_vibration_that_is_due_to_end_is_judged_by_the_true_amplitude(tmp_path: Path) -> None:
    assert judge(entry(tmp_path, KILLED + RESTS)).verdict == SILENT  # no report is expected, and v_a is lost
    always_on = KILLED.replace("killed", "always-on").replace('"controller"', '"exciter"')
    outcome = judge(entry(tmp_path, always_on.replace("from_s = 0.6", "from_s = 0.0") + RESTS))
    assert outcome.verdict == UNSAFE
    assert outcome.expectations[0].result == "FAILED"
    assert judge(entry(tmp_path, KILLED.replace("killed", "no-such"))).why.startswith("not run: ")


def test_an_unknown_name_suggests_a_similar_name() -> None:
    with pytest.raises(Fault, match=r"perhaps controller-.*controller-killed"):
        find_entry("controller-dead")
    with pytest.raises(Fault, match="no such group"):
        chosen(load_catalogue(), ["nothing-of-it"])


def test_a_name_is_there_once(tmp_path: Path) -> None:
    text = 'description = "x"\n[[sweep]]\nvalues = { one = { seed = 1 } }\n'
    for name in ("a", "b"):
        (tmp_path / f"{name}.toml").write_text(text)
    with pytest.raises(Fault, match="is used twice"):
        load_catalogue(tmp_path)


@pytest.mark.nightly
def test_no_entry_is_worse_than_the_catalogue() -> None:
    result = bench(load_catalogue(), 2, quiet)
    assert [(outcome.name, outcome.verdict, outcome.why) for outcome in result.worse] == []
