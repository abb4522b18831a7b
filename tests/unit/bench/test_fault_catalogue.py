"""The catalogue of faults is sound, and some of it is judged; all of it in the night."""

from pathlib import Path
from typing import Any

import pytest

from bench.faults.judge import SAFE, SILENT, UNSAFE, judge
from bench.faults.page import page
from bench.faults.run import FaultBench, bench, chosen
from bridge.faults import Fault
from bridge.results import strict_json
from cockpit.faults.catalogue import CatalogueEntry, find_entry, load_catalogue
from cockpit.run.scenario import load_scenario


def short(name: str, **changes: Any) -> CatalogueEntry:
    """An entry that is over soon."""
    one = find_entry(name)
    entry = one.entry.model_copy(update={"begin_s": 2.0, "watch_s": 0.4, "checked": True} | changes)
    return one.model_copy(update={"entry": entry})


def quiet(_share: float, _line: str) -> None:
    return


@pytest.mark.slow
def test_every_entry_is_a_scenario_with_its_faults() -> None:
    for case in load_catalogue():
        made = load_scenario(case.entry.scenario, case.settings)
        assert made.rig.solver.block_s > 0.0
        assert case.entry.fault or case.entry.said
        assert case.told or case.entry.told == [], case.entry.name


@pytest.mark.slow
def test_a_dead_controller_is_safe_and_reported_on_the_page() -> None:
    result = bench([short("controller-killed", watch_s=2.0)], 1, quiet)
    (outcome,) = result.outcomes
    assert (outcome.verdict, outcome.slips > 0) == (SAFE, True)
    assert outcome.told_as is not None
    assert outcome.told_as.word == "FALLBACK"
    assert outcome.zero_after_s is not None
    assert 0.05 < outcome.zero_after_s < 0.3
    text = page(result)
    assert "| `controller-killed` |" in text
    assert "**1 safe, 0 SILENT, 0 UNSAFE**" in text
    assert strict_json(result)["counts"] == {SAFE: 1, SILENT: 0, UNSAFE: 0}


@pytest.mark.slow
def test_a_fault_without_its_expected_event_is_silent_and_worse_than_the_catalogue() -> None:
    one = short("controller-killed")
    outcome = judge(one.model_copy(update={"told": ["NO_SUCH_WORD"]}))
    assert outcome.verdict == SILENT
    assert "FALLBACK" in outcome.why
    assert not outcome.as_known
    assert outcome._replace(open=SILENT).as_known
    assert FaultBench([outcome]).worse == [outcome]


@pytest.mark.slow
def test_a_vibration_that_is_due_to_end_and_does_not_is_unsafe() -> None:
    assert judge(short("controller-killed", fault=[], zero_s=0.3)).verdict == UNSAFE


def test_an_unknown_name_suggests_a_similar_name() -> None:
    with pytest.raises(Fault, match="perhaps controller-killed"):
        find_entry("controller-dead")
    with pytest.raises(Fault, match="no such group"):
        chosen(load_catalogue(), ["nothing-of-it"])


def test_a_name_is_there_once(tmp_path: Path) -> None:
    for name in ("a", "b"):
        text = 'about = "x"\n[[entry]]\nname = "one"\nabout = "y"\n'
        (tmp_path / f"{name}.toml").write_text(text)
    with pytest.raises(Fault, match="is used twice"):
        load_catalogue(tmp_path)


@pytest.mark.nightly
def test_no_entry_is_worse_than_the_catalogue() -> None:
    result = bench(load_catalogue(), 2, quiet)
    assert [(outcome.name, outcome.verdict, outcome.why) for outcome in result.worse] == []
