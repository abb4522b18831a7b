"""A small sealed set of rigs whose formulas the diagnosis does not know; `make blind` does it by the hundred."""

import json

import pytest
from typer.testing import CliRunner

from cockpit.cli import app
from tests.blind import making, strata
from tests.blind.__main__ import app as making_app
from tests.blind.independent_cases import Independent
from tests.blind.small_set import CASES, RUNS, SEED, known


def succeeds(command, *arguments):
    result = CliRunner().invoke(command, [*map(str, arguments)])
    assert result.exit_code == 0, result.output


@pytest.fixture(scope="module")
def tool(tmp_path_factory):
    folder = tmp_path_factory.mktemp("blind")
    sealed, key, scores = folder / "set", folder / "key.json", folder / "scores.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(making, "generator", lambda _name: Independent(RUNS))
        patch.setattr(making, "sized", known)
        patch.setattr(strata, "_real_faults", lambda: 0)  # measured logs have tests of their own
        asked = ("--cases", CASES, "--seed", SEED, "--out", sealed, "--key", key, "--jobs", 1)
        succeeds(making_app, "make", *asked)
    succeeds(app, "blind", "run", sealed)
    succeeds(app, "blind", "score", sealed, "--key", key, "--json", scores)
    found = json.loads(scores.read_text())
    assert found["sealed"] is True
    return found["methods"]["diagnosis"]


def test_every_case_was_diagnosed(tool):
    assert (tool["cases"], tool["faults"]) == (CASES, 0)


def test_visible_effects_are_named(tool):
    """Of seven single effects of two detection limits or more, all but one must come first."""
    assert tool["visible"]["top_1"]["n"] == 7
    assert tool["visible"]["top_1"]["value"] >= 6 / 7
    assert tool["visible"]["top_3"]["value"] == 1.0
    assert tool["visible"]["wrong"]["value"] == 0.0


def test_nothing_is_found_where_nothing_is(tool):
    """Three rigs inside their tolerances, two of them with other friction laws."""
    assert tool["false_alarms"]["n"] == 3
    assert tool["false_alarms"]["value"] == 0.0


def test_no_wrong_name_is_sure(tool):
    assert tool["sure_of_wrong_name"]["n"] == 18
    assert tool["sure_of_wrong_name"]["value"] == 0.0
