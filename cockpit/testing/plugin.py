"""The pytest plug-in: the fixture `rig`, and the logs and pictures of a failed test. Heavy imports wait for the fixture."""

from collections.abc import Generator, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import pytest

if TYPE_CHECKING:
    from cockpit.testing.api import Rig
    from cockpit.testing.session import Session

_SESSION: pytest.StashKey["Session"] = pytest.StashKey()


class MakeRig(Protocol):
    """The fixture `rig`."""

    def __call__(self, scenario: str, **settings: Any) -> "Rig":
        """The rig of a scenario, a name or the path of a .toml file, perhaps next to the test.

        `settings` are keys and tables of the scenario: seed=3, controller={"limits": {"v_ratio": 1.3}}.
        """
        ...


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("stickslip")
    group.addoption(
        "--stickslip-rig", metavar="RIG", default="", help="Rig by name or path in place of the scenarios' rigs."
    )
    group.addoption("--stickslip-arm", action="store_true", help="Arm a real rig for each run that the scenario arms.")
    group.addoption(
        "--stickslip-logs", metavar="FOLDER", default="runs/tests", help="Folder for logs and pictures of failed tests."
    )


def pytest_configure(config: pytest.Config) -> None:
    """Add the marker."""
    config.addinivalue_line("markers", "requirement(id): identifier of the requirement that a test verifies")


@pytest.fixture
def rig(request: pytest.FixtureRequest) -> Iterator[MakeRig]:
    """A function that gives the rig of a scenario: `rig("paper-c45-c45", seed=3).run(5)`."""
    from cockpit.testing.session import Session
    from cockpit.testing.target import Target

    target = Target(str(request.config.getoption("--stickslip-rig")), bool(request.config.getoption("--stickslip-arm")))
    with Session(request.path.parent, target) as session:
        request.node.stash[_SESSION] = session
        yield session.rig


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(
    item: pytest.Item, call: pytest.CallInfo[None]
) -> Generator[None, pytest.TestReport, pytest.TestReport]:
    """Add properties for JUnit XML, and keep the logs of a failed test."""
    session = item.stash.get(_SESSION, None)
    if session is not None and call.when == "call":
        marked = [str(name) for mark in item.iter_markers("requirement") for name in mark.args]
        item.user_properties += session.properties(marked)
    report = yield
    fault = call.excinfo.value if call.excinfo is not None else None
    if session is not None and getattr(getattr(fault, "kind", None), "code", "") == "QUARANTINED":
        report.longrepr = str(fault)  # the line names the remedy; a traceback would hide it
    if session is not None and report.when == "call" and report.failed:
        logs, lines = session.keep(Path(str(item.config.getoption("--stickslip-logs"))), item.nodeid)
        item.user_properties += [("log", str(log)) for log in logs]
        report.sections.append(("stickslip", "\n".join(lines)))
    return report
