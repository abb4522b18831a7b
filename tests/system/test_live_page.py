"""The page of a running rig in a browser with a simulated connection and clock: its age, its STOP, its first screen."""

import base64
import json
from typing import Any
from unittest.mock import patch

import pytest

from bridge.wire.bus_config import BusConfig
from cockpit.live.page import Page
from cockpit.live.server import Server
from cockpit.live.view import View
from tests.system.test_review import BROWSER, told_in_windows
from tests.unit.cockpit.live.made import Rig

pytestmark = [
    pytest.mark.nightly,
    pytest.mark.slow,
    pytest.mark.skipif(BROWSER is None, reason="no chromium on this computer"),
]
# replaces the connection; `up`: the server answers
_CONNECTION = """
<script>
let up = true, connection = null;
window.WebSocket = class {
  static OPEN = 1;
  constructor() {
    [this.readyState, this.sent, connection] = [0, [], this];
    setTimeout(() => up && ((this.readyState = 1), this.onopen()), 10);
  }
  send(text) { this.sent.push(JSON.parse(text).word); }
  close() {
    if (this.readyState < 3) setTimeout(() => this.onclose());
    this.readyState = 3;
  }
};
const bytes = (text) => Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0)).buffer;
function frame(table) {
  const text = new TextEncoder().encode(JSON.stringify({ rows: 0, count: 0, ...table }));
  const length = 4 * Math.ceil(text.length / 4);
  const made = new Uint8Array(4 + length).fill(32);
  new DataView(made.buffer).setUint32(0, length, true);
  made.set(text, 4);
  connection.onmessage({ data: made.buffer });
}
</script>
"""
# each step: the time to wait before it [ms], and its action or the name of a report
_STEPS = """
<script>
const FIRST = @FIRST@.map(bytes), NOW = @NOW@;
const now = (late_s = 0, more = {}) => frame({ ...NOW, sent_s: performance.now() / 1e3 - late_s, ...more });
const told = {};
const id = (name) => document.getElementById(name), wait = (ms) => new Promise((done) => setTimeout(done, ms));
const headline = () => document.querySelector("h1").textContent, line = () => (id("told").hidden ? "" : id("told").textContent);
const report = (name) => (told[name] = [headline(), line()]);
async function live(ms, more = {}) {
  for (let t = 0; t < ms; t += 50) {
    if (connection.readyState === 1) now(0, more);
    await wait(50);
  }
}
(async () => {
  await wait(50);
  for (const data of FIRST) connection.onmessage({ data });
  await live(500);
  told.curve_ends = document.querySelector(".u-wrap").getBoundingClientRect().bottom;
  told.width = document.documentElement.scrollWidth;
  told.open = document.querySelectorAll("#side details[open]").length;
  report("fresh");
  await wait(2000);
  report("old");
  now(6);
  report("late");
  await live(300);
  up = false;
  await wait(4000);
  report("lost");
  id("stop").click();
  report("trying");
  await wait(6000);
  report("not sent");
  up = true;
  await wait(4000);
  await live(300);
  report("back");
  connection.close();
  await wait(100);
  id("stop").click();
  await wait(2000);
  told.sent = connection.sent;
  frame({ kind: "answer", word: "STOP", done: false, lines: ["the rig did not confirm STOP"] });
  await live(300);
  report("refused");
  await live(300, { guard_state: "FAULT" });
  report("stopped");
  document.body.dataset.told = JSON.stringify(told);
})();
</script>
"""


@pytest.fixture(scope="module")
def reports(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict[str, Any]]:
    """The content of the page at each step, on a screen of 1280 by 720 pixels and on a phone of 390 by 844."""
    folder = tmp_path_factory.mktemp("live")
    rig = Rig()
    server = Server(BusConfig(), "", 8447)
    server._view = View(rig, "here", rig.clock)
    rig.blocks(range(100))
    server._view.step()
    with patch("cockpit.live.server.time.monotonic", return_value=0.0):  # the clock of the browser starts at 0
        first = json.dumps([base64.b64encode(part).decode() for part in server._first()])
    now = json.dumps(server._view.now() | {"kind": "now", "events": [], "viewers": 1, "viewers_dropped": 0})
    page = Page(8447).body.decode()
    page = page.replace("<script>", _CONNECTION + "<script>", 1)
    page = page.replace("</body>", _STEPS.replace("@FIRST@", first).replace("@NOW@", now) + "</body>")
    return told_in_windows(page, folder, {"screen": (1280, 720), "phone": (390, 844)})


@pytest.mark.parametrize(("name", "height", "width"), [("screen", 720, 1280), ("phone", 844, 390)])
def test_the_first_screen_has_a_whole_curve(
    reports: dict[str, dict[str, Any]], name: str, height: int, width: int
) -> None:
    assert reports[name]["curve_ends"] < height
    assert reports[name]["width"] <= width
    assert reports[name]["open"] == 0  # the table of words and the operator's commands are folded


def test_the_headline_names_the_age_of_old_data(reports: dict[str, dict[str, Any]]) -> None:
    shown = reports["screen"]
    assert shown["fresh"][0].startswith("EXCITE: vibrating")
    assert shown["old"][0] == f"2 s old: {shown['fresh'][0]}"
    assert shown["late"][0].startswith("no data for 6 s: this browser or its connection is too slow")
    assert "s: no connection to `stickslip serve`" in shown["lost"][0]


def test_stop_waits_for_a_connection_and_a_failure_goes_when_the_rig_answers(
    reports: dict[str, dict[str, Any]],
) -> None:
    shown = reports["screen"]
    assert "stop: no connection to the server; trying for 5 s" in shown["trying"][1]
    assert "stop: NOT SENT: no connection to the server for 5 s" in shown["not sent"][1]
    assert shown["back"][1] == ""
    assert shown["sent"] == ["STOP"]
    assert "stop: NOT DONE\nthe rig did not confirm STOP" in shown["refused"][1]
    assert shown["stopped"][1] == ""
