"""The page of a log in a real browser without a screen: it draws without an error, zooms, and shows a slip at every zoom."""

import html
import json
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import pytest
from typer.testing import CliRunner

from cockpit.cli import app
from cockpit.review.page import write_review
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from diagnosis.report.page import report_page
from tests import made_up
from tests.logs import short_log
from tests.unit.cockpit.test_look_command import tribometer

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.nightly,
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no chromium on this computer"),
]
MOST_BYTES = 5e6
# actions of a user: drags over the first plot from a quarter to the half of its width, then clicks `next slip`
_PERSON = """
<script>
const told = { plots: document.querySelectorAll(".uplot").length, whole: document.getElementById("shown").textContent };
const over = document.querySelector(".u-over"), box = over.getBoundingClientRect();
const mouse = (kind, share, target = over) =>
  target.dispatchEvent(new MouseEvent(kind, {
    bubbles: true, button: 0, movementX: 1, clientX: box.left + share * box.width, clientY: box.top + 50,
  }));
mouse("mousemove", 0.25); mouse("mousedown", 0.25); mouse("mousemove", 0.5); mouse("mouseup", 0.5, document);
told.dragged = document.getElementById("shown").textContent;
document.getElementById("slip").click();
told.slip = document.getElementById("shown").textContent;
document.querySelectorAll("details").forEach((one) => (one.open = true));
setTimeout(() => {
  told.opened = document.querySelectorAll(".uplot").length;
  const pixels = document.querySelector(".uplot canvas");
  const drawn = pixels.getContext("2d").getImageData(0, 0, pixels.width, pixels.height).data;
  told.ink = drawn.filter((value, at) => at % 4 === 3 && value > 200).length;
  document.body.dataset.told = JSON.stringify(told);
}, 500);
</script>
"""
_NO_HISTORY = "<head><script>history.replaceState = () => {};</script>"  # a page inside of a page has none
_COLLECT = """
<script>
setInterval(() => {
  const frames = [...document.querySelectorAll("iframe")], told = (frame) => frame.contentDocument.body?.dataset.told;
  if (!frames.every(told)) return;
  document.body.dataset.told = JSON.stringify(Object.fromEntries(frames.map((frame) => [frame.id, JSON.parse(told(frame))])));
}, 1000);
</script>
"""


def told_by(page: Path, folder: Path) -> Any:
    """The `data-told` that the scripts of a page leave; an error of a script fails the test."""
    command = [
        str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'browser'}",
        "--window-size=1280,1600", "--virtual-time-budget=60000", "--enable-logging=stderr", "--dump-dom", page.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=280, check=True)
    assert "CONSOLE" not in done.stderr, done.stderr
    state = re.search(r'<body[^>]* data-told="([^"]*)"', done.stdout)
    assert state is not None
    return json.loads(html.unescape(state[1]))


def told_in_windows(page: str, folder: Path, sizes: dict[str, tuple[int, int]]) -> dict[str, Any]:
    """The same of a page in windows of these sizes, by their names."""
    page = html.escape(page.replace("<head>", _NO_HISTORY, 1))
    frames = "".join(
        f'<iframe id="{name}" width="{width}" height="{height}" style="border: 0" srcdoc="{page}"></iframe>'
        for name, (width, height) in sizes.items()
    )
    outer = folder / "outer.html"
    outer.write_text(f'<!doctype html><meta charset="utf-8">{frames}{_COLLECT}')
    return told_by(outer, folder)


def opened(page: Path, folder: Path) -> dict[str, str | int]:
    """The report of the page of a log after an operator used it."""
    used = page.with_name("used.html")
    used.write_text(page.read_text().replace("</body>", _PERSON + "</body>"))
    return told_by(used, folder)


@pytest.mark.timeout(300)
def test_the_page_zooms_into_one_log_and_into_two(tmp_path: Path) -> None:
    logs = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    for log, ratio in zip(logs, ("1.2", "1.6"), strict=True):
        run_onboard(load_scenario("paper-c45-c45", ["duration_s=14.0", f"controller.limits.v_ratio={ratio}"]), log, {})
    for shown in (logs[:1], logs):
        page = tmp_path / "page.html"
        write_review(shown, page)
        assert page.stat().st_size < MOST_BYTES
        state = opened(page, tmp_path)
        assert state["plots"] == 4
        assert state["opened"] == 7
        assert state["whole"] == "0.001 to 14.000 s"
        from_s, to_s = (float(time) for time in str(state["dragged"]).removesuffix(" s").split(" to "))
        assert from_s == pytest.approx(3.5, abs=0.1)
        assert to_s == pytest.approx(7.0, abs=0.1)
        from_s, to_s = (float(time) for time in str(state["slip"]).removesuffix(" s").split(" to "))
        assert from_s < 2.98 < to_s  # the first breakaway
        assert int(state["ink"]) > 1000


def test_pages_of_results_fit_a_phone(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(short_log())
    write_review([tmp_path / "run.mcap"], tmp_path / "review.html")
    look = CliRunner().invoke(app, ["look", str(tribometer(tmp_path)), "--out", str(tmp_path / "look.html")])
    assert look.exit_code == 0, look.output
    pages = [(tmp_path / name).read_text() for name in ("review.html", "look.html")]
    script = "<script>document.body.dataset.told = JSON.stringify(document.documentElement.scrollWidth)</script></body>"
    for page in (*pages, report_page(made_up.diagnosis(), "rig")):
        assert told_in_windows(page.replace("</body>", script), tmp_path, {"phone": (390, 844)})["phone"] <= 390
