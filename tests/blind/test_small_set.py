"""A small sealed set of rigs whose formulas the diagnosis does not know; `make blind` does it by the hundred."""

import json

import pytest
from typer.testing import CliRunner

from bench.app import app
from tests.blind import making, strata
from tests.blind.__main__ import app as making_app
from tests.blind.independent_cases import Independent
from tests.blind.small_set import ALL, CASES, FEW, RUNS, SEED, known

pytestmark = [pytest.mark.slow, pytest.mark.timeout(3600)]  # of all cases, on a busy computer


def succeeds(command, *arguments):
    result = CliRunner().invoke(command, [*map(str, arguments)])
    assert result.exit_code == 0, result.output


@pytest.fixture(
    scope="module", params=[pytest.param(FEW, id="few"), pytest.param(ALL, id="all", marks=pytest.mark.nightly)]
)
def part(request):
    return request.param


@pytest.fixture(scope="module")
def tool(part, tmp_path_factory):
    folder = tmp_path_factory.mktemp("blind")
    sealed, key, scores = folder / "set", folder / "key.json", folder / "scores.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(making, "generator", lambda _name: Independent(RUNS))
        patch.setattr(making, "sized", known)
        patch.setattr(making, "draw", lambda *asked: [case for case in strata.draw(*asked) if case.seed in part.seeds])
        asked = ("--cases", CASES, "--seed", SEED, "--out", sealed, "--key", key, "--jobs", 1)
        succeeds(making_app, "make", *asked)
    succeeds(app, "blind", "run", sealed, "--jobs", part.jobs)
    succeeds(app, "blind", "score", sealed, "--key", key, "--json", scores)
    scores_table = json.loads(scores.read_text())
    assert scores_table["sealed"] is True
    return scores_table["methods"]["diagnosis"]


def test_every_case_was_diagnosed(tool, part):
    assert (tool["cases"], tool["faults"]) == (len(part.seeds), 0)


def test_visible_effects_are_named(tool, part):
    """Of the single effects of two detection limits or more, one in seven may have another first."""
    assert tool["visible"]["top_1"]["n"] == part.visible
    assert tool["visible"]["top_1"]["value"] >= 6 / 7
    assert tool["visible"]["top_3"]["value"] == 1.0
    assert tool["visible"]["wrong"]["value"] == 0.0


def test_nothing_is_found_where_nothing_is(tool, part):
    """Rigs inside their tolerances, most of them with other friction laws."""
    assert tool["false_alarms"]["n"] == part.without_gap
    assert tool["false_alarms"]["value"] == 0.0


def test_no_wrong_name_is_sure(tool, part):
    assert tool["sure_of_wrong_name"]["n"] == len(part.seeds) - part.without_gap
    assert tool["sure_of_wrong_name"]["value"] == 0.0
