"""All pages share one style sheet and one frame; no template defines colours or a frame."""

import re
from pathlib import Path

import pytest
from matplotlib.figure import Figure

from bridge.pages import STYLE, filled_page, png
from cockpit.live.page import Page
from cockpit.review.page import write_review
from diagnosis.report.page import report_page
from tests import made_up
from tests.logs import short_log

ROOT = Path(__file__).parents[3]
TEMPLATES = [
    path
    for package in ("bench", "cockpit", "diagnosis")
    for ending in ("*.html", "*.html.j2")
    for path in sorted((ROOT / package).rglob(ending))
]
_OWN_COLOUR = re.compile(r'style="[^"]*(?:color|background|border|#)|<style|fill="|#[0-9a-f]{6}', re.IGNORECASE)


def name_of(template: Path) -> str:
    return str(template.relative_to(ROOT))


@pytest.mark.parametrize("template", TEMPLATES, ids=name_of)
def test_a_template_has_one_h1_and_leaves_colours_to_the_style_sheet(template: Path) -> None:
    text = template.read_text()
    assert text.count("<h1") == 1
    assert not _OWN_COLOUR.search(text)
    assert text.count("<table") == text.count('<div class="wide" tabindex="0"><table')  # scrolls inside its box
    assert "<th></th>" not in text


def test_there_is_one_style_sheet() -> None:
    colours = {
        name_of(path) for top in ("bridge", "bench", "cockpit", "diagnosis") for path in (ROOT / top).rglob("*.css")
    }
    assert colours == {"bridge/page.css", "cockpit/review/vendor/uPlot.min.css"}


@pytest.mark.slow
def test_every_kind_of_page_has_the_style_sheet_once_and_one_main(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(short_log())
    write_review([tmp_path / "run.mcap"], tmp_path / "review.html")
    pages = [report_page(made_up.diagnosis(), "rig"), Page(8447).body.decode(), (tmp_path / "review.html").read_text()]
    for page in pages:
        assert page.count("<style>") == page.count("<main") == page.count("</main>") == page.count("<h1") == 1
        assert STYLE.read_text() in page


def test_every_colour_has_a_dark_value() -> None:
    light, dark = re.findall(r":root \{(.*?)\}", STYLE.read_text(), re.DOTALL)
    assert set(re.findall(r"--[a-z]+(?=:)", light)) == set(re.findall(r"--[a-z]+(?=:)", dark))


def test_titles_and_values_are_text(tmp_path: Path) -> None:
    template = tmp_path / "x.html.j2"
    template.write_text("<h1>{{ name }}</h1>")
    page = filled_page(template, "<b>", "<footer>x</footer>", name="<i>")
    assert "<title>&lt;b&gt;</title>" in page
    assert "<main>\n<h1>&lt;i&gt;</h1>\n</main>\n<footer>x</footer>" in page


def test_a_picture_is_transparent() -> None:
    assert png(Figure(figsize=(0.1, 0.1)), 10.0) == png(Figure(figsize=(0.1, 0.1), facecolor="red"), 10.0)
