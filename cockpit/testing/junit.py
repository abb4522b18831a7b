"""Results of tests as JUnit XML, which build servers read."""

from collections.abc import Sequence
from importlib.metadata import version
from xml.etree import ElementTree as Xml

from cockpit.expect.judge import FAILED, PASSED, UNTESTED, Expected
from cockpit.testing.one import ERROR, Tested
from cockpit.testing.suite import Suite


def junit(suite: Suite) -> str:
    """The XML. UNTESTED is an error there: a skipped test would count as good. A missed defect of a mutant is a failure."""
    counts = {"tests": len(suite.tests), "failures": 0, "errors": 0}
    root = Xml.Element("testsuite", name="stickslip")
    for test in suite.tests:
        name = f"{test.name} with {test.defect}" if test.defect else test.name
        case = Xml.SubElement(root, "testcase", classname=test.file, name=name)
        properties = Xml.SubElement(case, "properties")
        rows = properties_of(test.rig, test.seed, test.checksum, test.expectations)
        for key, value in [*rows, *([("log", test.log)] if test.log else [])]:
            Xml.SubElement(properties, "property", name=key, value=value)
        kind = _kind(test, suite.mutants)
        if kind:
            counts["failures" if kind == "failure" else "errors"] += 1
            lines = test.in_words()
            Xml.SubElement(case, kind, message=f"{test.result}: {test.why}").text = "\n".join(lines)
    for key, count in counts.items():
        root.set(key, str(count))
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _kind(test: Tested, mutant: bool) -> str:
    """Element of a test that is not good; empty for a good one."""
    if mutant:
        return "" if test.result == FAILED else "failure"
    return {PASSED: "", FAILED: "failure", UNTESTED: "error", ERROR: "error"}[test.result]


def properties_of(rig: str, seed: int, checksum: str, expected: Sequence[Expected]) -> list[tuple[str, str]]:
    """Properties of a run: its rig, seed, version, SHA-256 of its log, and the requirements that its expectations verify."""
    requirements = dict.fromkeys(row.requirement for row in expected if row.requirement)
    fixed = {"rig": rig, "seed": str(seed), "version": version("stickslip"), "checksum": checksum}
    return [*((key, value) for key, value in fixed.items() if value), *(("requirement", name) for name in requirements)]
