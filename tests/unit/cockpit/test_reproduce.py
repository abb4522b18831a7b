"""`stickslip reproduce`: one page that opens offline, and every check of it."""

import json
import re

import pytest

from bridge.results import strict_json
from cockpit.paper.claims import PaperRow
from cockpit.paper.page import reproduce

# 19 s of CPU; tests/truth/test_paper.py has the numbers of the same runs
pytestmark = [pytest.mark.slow, pytest.mark.nightly]


@pytest.fixture(scope="module")
def report(tmp_path_factory):
    path = tmp_path_factory.mktemp("reproduce") / "reproduce.html"
    return reproduce(path), path.read_text(encoding="utf-8")


def test_every_check_holds(report):
    result, _ = report
    assert [row for row in result.rows if not row.passed] == []
    assert result.passed
    assert len(result.rows) >= 60
    assert result.verdict in report[1]


def test_the_page_needs_nothing_from_outside(report):
    _, page = report
    assert not re.search(r"https?://|<link|<script|@import|url\(", page)
    sources = re.findall(r'src="([^"]{0,30})', page)
    assert len(sources) == 7
    assert all(source.startswith("data:image/png;base64,") for source in sources)
    assert len(page) < 5e6


def test_the_page_names_every_claim(report):
    result, page = report
    assert page.count(">holds<") == len(result.rows)
    assert "FAILS" not in page


def test_one_failing_check_is_a_failing_result(report):
    result, _ = report
    failed = result._replace(rows=[*result.rows, PaperRow("claim", "1 N", "2 N", False, group="group")])
    assert not failed.passed
    assert f"{len(result.rows)} of {len(failed.rows)} checks" in failed.verdict


def test_the_result_is_plain_json(report):
    result, _ = report
    again = json.loads(json.dumps(strict_json(result)))
    assert again["passed"] is True
    assert {"group", "claim", "found", "criterion", "passed", "deviation_percent"} == set(again["rows"][0])
