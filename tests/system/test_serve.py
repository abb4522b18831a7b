"""The page of a rig that runs, in a real browser without a screen: it sees curves, and its STOP stops the rig."""

import asyncio
import json
import os
import re
import shutil
import subprocess
import threading
import time
import urllib.request
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
from websockets.asyncio.client import connect

from bridge.log.logfile import read_run
from tests.patience import PATIENCE_S
from tests.system.run_under_way import COMMAND, Run

BROWSER = next(filter(None, map(shutil.which, ("chromium", "chromium-browser", "google-chrome"))), None)
CORE_SHARE = 0.15  # of the server, with a page that sees all signals 20 times a second
_MEASURED_S = 4.0
pytestmark = [pytest.mark.nightly, pytest.mark.slow, pytest.mark.realtime]
# the canvas of the first plot, and its curve
_INK = """(() => {
  const pixels = document.querySelector(".uplot canvas");
  if (!pixels) return 0;
  const drawn = pixels.getContext("2d").getImageData(0, 0, pixels.width, pixels.height).data;
  return store?.end ? drawn.filter((value, at) => at % 4 === 3 && value > 200).length : 0;
})()"""


@contextmanager
def served(endpoint: str) -> Generator[tuple[str, str, int]]:
    """The address of the page, its token, and the process."""
    process = subprocess.Popen(
        [*COMMAND, "serve", "--port", "0", "--endpoint", endpoint], stderr=subprocess.PIPE, text=True
    )
    try:
        assert process.stderr is not None
        page, token = process.stderr.readline(), process.stderr.readline()
        yield page.split()[1], token.split()[1], process.pid
    finally:
        process.terminate()
        process.communicate(timeout=10.0)
    assert process.returncode == 0


@contextmanager
def browser(folder: Path) -> Generator[str]:
    """The address at which a browser is driven."""
    assert BROWSER is not None
    command = [
        BROWSER, "--headless", "--no-sandbox", "--disable-gpu", f"--user-data-dir={folder}", "--remote-debugging-port=0",
        "--window-size=1280,1600", "about:blank",
    ]  # fmt: skip
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    try:
        told = folder / "DevToolsActivePort"
        until_s = time.monotonic() + 30.0
        while not (told.exists() and len(told.read_text().split()) == 2):
            assert time.monotonic() < until_s, "the browser did not start"
            time.sleep(0.05)
        port = told.read_text().split()[0]
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/json") as answer:
            yield next(target["webSocketDebuggerUrl"] for target in json.load(answer) if target["type"] == "page")
    finally:
        process.terminate()
        process.wait(10.0)


class Tab:
    """One tab of the browser."""

    def __init__(self, socket: Any) -> None:
        self._socket, self._number = socket, 0
        self.errors: list[str] = []

    async def call(self, method: str, **parameters: Any) -> Any:
        self._number += 1
        await self._socket.send(json.dumps({"id": self._number, "method": method, "params": parameters}))
        while True:
            told = json.loads(await asyncio.wait_for(self._socket.recv(), 30.0))
            if told.get("method") in {"Runtime.exceptionThrown", "Runtime.consoleAPICalled"}:
                self.errors.append(json.dumps(told["params"])[:500])
            if told.get("id") == self._number:
                return told["result"]

    async def run(self, script: str) -> Any:
        return (await self.call("Runtime.evaluate", expression=script, returnByValue=True))["result"].get("value")

    async def until(self, script: str, good: Callable[[Any], bool], within_s: float) -> Any:
        until_s = time.monotonic() + within_s
        while not good(found := await self.run(script)):
            assert time.monotonic() < until_s, f"{script}: {found}"
            await asyncio.sleep(0.05)
        return found


@pytest.mark.skipif(BROWSER is None, reason="no chromium on this computer")
@pytest.mark.timeout(200)
def test_an_operator_sees_a_run_and_stops_it(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / "run.mcap", "--scenario", "from-the-start", seconds=95.0)
    runs.append(run)
    endpoint = run.process.args[run.process.args.index("--endpoint") + 1]  # type: ignore[union-attr,index,operator]
    run.wait_until_recording()
    with served(str(endpoint)) as (page, token, pid), browser(tmp_path / "browser") as driven:
        asyncio.run(_look(driven, page, token, pid))
    run.process.send_signal(2)
    run.end()
    texts = [event.text for event in read_run(run.log).events if event.code == "OPERATOR"]
    assert next(text.split()[0] for text in texts if text.startswith(("STOP", "RESET"))) == "STOP"
    assert any(text.startswith("RESET") for text in texts)


def cpu_s(pid: int) -> float:
    """CPU time that a process has used."""
    fields = Path(f"/proc/{pid}/stat").read_text().rsplit(")", 1)[1].split()
    return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")


def busy() -> float:
    """Processes per core, at least 1: timed actions take as many times longer."""
    return max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


async def _look(driven: str, page: str, token: str, pid: int) -> None:
    async with connect(driven, max_size=None) as socket:
        tab = Tab(socket)
        await tab.call("Runtime.enable")
        await tab.call("Page.enable")
        await tab.call("Page.navigate", url=page)
        await tab.until(_INK, lambda ink: ink is not None and ink > 1000, PATIENCE_S)
        before_s = cpu_s(pid)
        await asyncio.sleep(_MEASURED_S)
        assert (cpu_s(pid) - before_s) / _MEASURED_S < CORE_SHARE * busy()
        assert await tab.run("document.querySelectorAll('.uplot').length") == 4
        texts = await tab.until(
            "document.getElementById('said').textContent", lambda text: "in the last" in (text or ""), 5.0
        )
        assert re.search(r"slips? in the last \d+ s; [A-Z]+: ", texts)
        await tab.run("document.getElementById('stop').click()")
        await tab.until("document.getElementById('told').textContent", lambda text: "done after" in text, 8.0)
        await tab.until(
            "document.getElementById('said').textContent", lambda text: text.startswith("FAULT: STOP_BY_PERSON"), 5.0
        )
        await tab.run("document.querySelector('[data-word=RESET]').click()")
        await tab.until("document.getElementById('told').textContent", lambda text: "wrong token" in text, 5.0)
        await tab.run(f"document.getElementById('token').value = {json.dumps(token)}")
        await tab.run("document.querySelector('[data-word=RESET]').click()")
        await tab.until(
            "document.getElementById('told').textContent", lambda text: "reset" in text and "done after" in text, 8.0
        )
        await tab.until("document.getElementById('said').textContent", lambda text: text.startswith("DISARMED"), 5.0)
        assert tab.errors == []


def test_watch_ends_at_ctrl_c_and_its_lines_are_json(tmp_path: Path, runs: list[Run]) -> None:
    run = Run(tmp_path / "run.mcap", "--scenario", "from-the-start", seconds=60.0)
    runs.append(run)
    endpoint = run.process.args[run.process.args.index("--endpoint") + 1]  # type: ignore[union-attr,index,operator]
    run.wait_until_recording()
    words = [*COMMAND, "watch", "--json", "--every", "0.2", "--endpoint", str(endpoint)]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True) as process:
        killer = threading.Timer(60.0, process.kill)
        killer.start()
        assert process.stdout is not None
        lines = [json.loads(process.stdout.readline()) for _ in range(15)]
        process.send_signal(2)
        assert process.wait(10.0) == 0
        killer.cancel()
    run.process.send_signal(2)
    run.end()
    live = [line for line in lines if line["phase"] == "live"]
    assert len(live) > 5
    assert live[-1]["t_s"] > live[0]["t_s"]
    assert live[-1]["mode"] in {"WATCH", "EXCITE", "DISABLED", "PROBE"}
