"""One offline page of many tests: the verdict, then each test with its picture, failed ones first."""

from importlib.metadata import version
from pathlib import Path

from bridge.pages import filled_page
from bridge.units import counted
from cockpit.testing.suite import Suite


def page(suite: Suite) -> str:
    """The page as HTML."""
    values = {"suite": suite, "counted": counted, "version": version("stickslip")}
    return filled_page(Path(__file__).with_name("page.html.j2"), "Tests of stickslip", **values)
