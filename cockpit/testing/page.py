"""One offline page of many tests: the verdict, then each test with its picture, failed ones first."""

from html import escape
from importlib.metadata import version

from bridge.pages import whole_page
from bridge.units import counted
from cockpit.testing.one import Tested
from cockpit.testing.suite import Suite


def page(suite: Suite) -> str:
    """The page as HTML."""
    what = counted(len(suite.tests), "defect" if suite.mutants else "test")
    counts = ", ".join(f"{number} {result}" for result, number in suite.counts.items() if number)
    head = f"<h1>{what} of stickslip {version('stickslip')}</h1>\n"
    head += f'<p class="verdict {"bad" if suite.exit_status else "good"}">{counts}</p>\n'
    tests = "".join(map(_test, sorted(suite.tests, key=lambda test: test.result)))
    return whole_page("Tests of stickslip", f"<main>\n{head}{tests}</main>\n")


def _test(test: Tested) -> str:
    name = f"{test.name} with {test.defect}" if test.defect else test.name
    about = [test.file, *([f"rig {test.rig}", f"seed {test.seed}"] if test.rig else [])]
    about += [f"log {test.log or 'deleted'}", f"SHA-256 {test.checksum[:16]}"] if test.checksum else []
    rows = "".join(f'<p class="small">{escape(row.in_words())}</p>\n' for row in test.expectations)
    small = f'<span class="small">{escape(", ".join(about))}</span>'
    head = f'<h3 id="{escape(test.name)}">{test.result} {escape(name)}</h3>\n<p>{escape(test.why)}\n<br>{small}</p>\n'
    return f"{head}{test.picture}\n{rows}"
