"""The page of a log in a real browser without a screen: it draws without an error, zooms, and shows a slip at every zoom."""

import json
import re
import shutil
import subprocess
from pathlib import Path

import pytest

from cockpit.review.page import write_review
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
pytestmark = [
    pytest.mark.nightly,
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no chromium on this computer"),
]
MOST_BYTES = 5e6
# what a person does: drags over the first plot from a quarter to the half of its width, then clicks `next slip`
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


def opened(page: Path, folder: Path) -> dict[str, str | int]:
    """What the page says of itself after a person used it; an error of a script fails the test."""
    used = page.with_name("used.html")
    used.write_text(page.read_text().replace("</body>", _PERSON + "</body>"))
    command = [
        str(BROWSER), "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder / 'browser'}",
        "--window-size=1280,1600", "--virtual-time-budget=10000", "--enable-logging=stderr", "--dump-dom", used.as_uri(),
    ]  # fmt: skip
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    assert 'data-ready="yes"' in done.stdout
    assert "CONSOLE" not in done.stderr
    told = re.search(r'data-told="([^"]*)"', done.stdout)
    assert told is not None
    return json.loads(told[1].replace("&quot;", '"'))


@pytest.mark.timeout(300)
def test_a_person_can_zoom_into_one_log_and_into_two(tmp_path: Path) -> None:
    logs = [tmp_path / "a.mcap", tmp_path / "b.mcap"]
    for log, ratio in zip(logs, ("1.2", "1.6"), strict=True):
        run_onboard(load_scenario("paper-c45-c45", ["duration_s=14.0", f"controller.limits.v_ratio={ratio}"]), log, {})
    for shown in (logs[:1], logs):
        page = tmp_path / "page.html"
        write_review(shown, page)
        assert page.stat().st_size < MOST_BYTES
        told = opened(page, tmp_path)
        assert told["plots"] == 4
        assert told["opened"] == 7
        assert told["whole"] == "0.001 to 14.000 s"
        from_s, to_s = (float(one) for one in str(told["dragged"]).removesuffix(" s").split(" to "))
        assert from_s == pytest.approx(3.5, abs=0.1)
        assert to_s == pytest.approx(7.0, abs=0.1)
        from_s, to_s = (float(one) for one in str(told["slip"]).removesuffix(" s").split(" to "))
        assert from_s < 2.98 < to_s  # the first breakaway
        assert int(told["ink"]) > 1000
