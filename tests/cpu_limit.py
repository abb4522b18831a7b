"""Limits on the CPU time of the quick tests; the wall time depends on other programs.

They do not judge the product. They keep `make quick` quick: an expensive test carries the marker `slow`.
"""

import resource
import time
from collections.abc import Generator

import pytest

LARGE = {"slow", "nightly", "realtime"}  # markers of tests without a limit
BEGAN = pytest.StashKey[float]()
_COST = "cpu_s"  # in the teardown report: CPU time of setup, call and teardown together


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("stickslip")
    group.addoption("--cpu-each", type=float, default=0.0, metavar="S", help="CPU of a test that is not marked; 0: any")
    group.addoption("--cpu-all", type=float, default=0.0, metavar="S", help="CPU of all tests together; 0: any")


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item: pytest.Item) -> Generator[None, object, object]:
    item.stash[BEGAN] = _cpu_s()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, object, object]:
    result = yield
    cost_s, most_s = _cpu_s() - item.stash[BEGAN], item.config.option.cpu_each
    item.user_properties.append((_COST, cost_s))
    if 0.0 < most_s < cost_s and not LARGE.intersection(mark.name for mark in item.iter_markers()):
        pytest.fail(f"{cost_s:.1f} s of CPU: must be {most_s:g} s at most; do it with less, or mark it slow", False)
    return result


@pytest.hookimpl(trylast=True)
def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    if most_s := config.option.cpu_all:
        terminalreporter.write_line(
            f"CPU of all tests: {_total_s(terminalreporter):.0f} s; must be {most_s:g} s at most"
        )


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish(session: pytest.Session) -> None:
    reporter = session.config.pluginmanager.get_plugin("terminalreporter")
    most_s = session.config.option.cpu_all
    if most_s and reporter is not None and _total_s(reporter) > most_s and session.exitstatus == pytest.ExitCode.OK:
        session.exitstatus = pytest.ExitCode.TESTS_FAILED


def _total_s(reporter: pytest.TerminalReporter) -> float:
    reports = [report for group in reporter.stats.values() for report in group if isinstance(report, pytest.TestReport)]
    return sum(
        value
        for report in reports
        if report.when == "teardown"
        for key, value in report.user_properties
        if key == _COST
    )


def _cpu_s() -> float:
    """Of this process and of its children that have ended."""
    children = resource.getrusage(resource.RUSAGE_CHILDREN)
    return time.process_time() + children.ru_utime + children.ru_stime
