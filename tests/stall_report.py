"""Stalls of the computer while tests in real time run: reported, and with `--excuse-stalls` a reason why a test may fail.

A loop in real time is in time only while the computer runs. The product's timers measure the stalls; where they get no
real-time priority, a thread of this process measures how late it wakes.
"""

import threading
import time
from collections.abc import Generator
from typing import Protocol

import pytest

from bridge.wire.pauses import Pause, PauseWatch
from controller.config import LimitsConfig

# The controller leaves out blocks that are older (LATE, STALE). Shorter: a stall that no test can see would excuse a failure.
LEAST_NS = round(LimitsConfig().stale_after_s * 1e9)
_PERIOD_S = 0.002  # of the thread: a stall may look shorter by as much
_SETTLING_S = 0.1  # the timers report a stall up to 50 ms after its end
_EXCUSE = "--excuse-stalls"


class Watch(Protocol):
    """Sees stalls until it is closed."""

    def poll(self) -> list[Pause]: ...

    def close(self) -> None: ...


class _Thread:
    """Replaces the timers: without a priority it also counts the time in which other programs used its core."""

    def __init__(self) -> None:
        self._found: list[Pause] = []
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._look, daemon=True)
        self._thread.start()

    def _look(self) -> None:
        last_ns = time.perf_counter_ns()
        while not self._over.wait(_PERIOD_S):
            now_ns = time.perf_counter_ns()
            if now_ns - last_ns > LEAST_NS:
                self._found.append(Pause(last_ns, now_ns))
            last_ns = now_ns

    def poll(self) -> list[Pause]:
        stalls, self._found = self._found, []
        return stalls

    def close(self) -> None:
        self._over.set()
        self._thread.join()


class Stalls:
    """Stalls by test."""

    def __init__(self, watch: Watch, excuse: bool) -> None:
        self.watch, self.excuse = watch, excuse
        self.found: dict[str, list[Pause]] = {}

    def _take(self, test: str) -> None:
        if long := [pause for pause in self.watch.poll() if pause.until_ns - pause.from_ns >= LEAST_NS]:
            self.found.setdefault(test, []).extend(long)

    @pytest.hookimpl(wrapper=True)
    def pytest_runtest_makereport(self, item: pytest.Item) -> Generator[None, pytest.TestReport, pytest.TestReport]:
        report = yield
        if report.failed:
            time.sleep(_SETTLING_S)
        self._take(item.nodeid)
        if report.failed and self.excuse and item.nodeid in self.found:
            report.outcome = "skipped"
            report.wasxfail = words(self.found[item.nodeid])
        return report

    def pytest_terminal_summary(self, terminalreporter: pytest.TerminalReporter) -> None:
        every = [pause for stalls in self.found.values() for pause in stalls]
        terminalreporter.write_line(f"computer {words(every)}")
        for test, stalls in self.found.items():
            terminalreporter.write_line(f"  during {test}: {words(stalls)}")
        for report in terminalreporter.stats.get("xfailed", []):
            terminalreporter.write_line(
                f"NOT JUDGED {report.nodeid}: the computer {report.wasxfail}\n{report.longreprtext}"
            )

    def pytest_unconfigure(self) -> None:
        self.watch.close()


def words(stalls: list[Pause]) -> str:
    """`stalled 2 times, longest 41 ms`."""
    if not stalls:
        return f"never stalled for {LEAST_NS / 1e6:g} ms"
    longest_ms = max(stall.until_ns - stall.from_ns for stall in stalls) / 1e6
    return f"stalled {len(stalls)} time{'s' * (len(stalls) > 1)}, longest {longest_ms:.0f} ms"


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("stickslip")
    group.addoption("--stalls", action="store_true", help="report stalls of the computer, by test")
    group.addoption(_EXCUSE, action="store_true", help="a test that fails during a stall is reported and fails nothing")


def pytest_configure(config: pytest.Config) -> None:
    if config.option.stalls or config.option.excuse_stalls:
        watch = PauseWatch()
        config.pluginmanager.register(Stalls(watch if not watch.refused else _Thread(), config.option.excuse_stalls))
