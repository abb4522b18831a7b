"""The page of `stickslip reproduce` from a few rows; test_reproduce.py makes the whole of it, at night."""

import re
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bridge.results import strict_json
from cockpit.paper import page, plots
from cockpit.paper.claims import PaperRow, parameter_rows

CLAIM = PaperRow("the slips fade", "5 N < 6 N", "smaller", True)


@pytest.fixture
def runs(monkeypatch: pytest.MonkeyPatch) -> dict[Any, Any]:
    """Two runs with the numbers that the text of the page has, and one picture in place of the seven."""
    monkeypatch.setattr(page, "figures", lambda _: [plots.PageFigure("Figure 2", "without vibration", "AAAA")])
    course = SimpleNamespace(t_s=np.array([9.0, 15.0]), drive_force_N=np.array([20.0, 13.5]))
    run = SimpleNamespace(course=course, mean=SimpleNamespace(period_s=2.0), scatter=SimpleNamespace(period_s=0.05))
    return {("C45-C45 @ 0.063", frequency_Hz): run for frequency_Hz in (1000, 5000)}


def test_the_page_has_every_check_and_needs_nothing_from_outside(runs: dict[Any, Any]) -> None:
    result = page.ReproduceResult([CLAIM, *parameter_rows()], 12.0)
    made = page._page(result, runs)
    assert made.count(">holds<") == len(result.rows)
    assert "FAILS" not in made
    assert result.verdict in made
    assert "scatters by 2.5 %" in made
    assert "would read 13.50 N" in made
    assert re.findall(r'src="([^"]*)', made) == ["data:image/png;base64,AAAA"]
    assert not re.search(r"https?://|<link|<script|@import|url\(", made)
    assert "5 N &lt; 6 N" in made


def test_a_check_that_fails_is_marked_and_counted(runs: dict[Any, Any]) -> None:
    result = page.ReproduceResult([CLAIM, CLAIM._replace(passed=False)], 12.0)
    assert (result.passed, strict_json(result)["passed"]) == (False, False)
    made = page._page(result, runs)
    assert "1 of 2 claims of the paper hold; 1 of 2 checks in all; failures are marked red below" in made
    assert made.count(">FAILS<") == 1
