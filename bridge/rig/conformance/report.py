"""The results of the checks: one line each, and JUnit for a build server."""

from collections.abc import Callable
from typing import NamedTuple
from xml.etree import ElementTree as Xml

from bridge.results import in_json

OK, FAILED, SKIPPED = "ok", "FAILED", "skipped"


class Measured(NamedTuple):
    """The figure of a check, before it is judged. Raise `NotSeen` if the session does not show it."""

    passed: bool
    value: str
    limit: str


class NotSeen(Exception):
    """The session does not show the needs of a check; the text gives the reason."""


class Check(NamedTuple):
    """One check: its name, the question and the remedy; the checks that it needs are passed, or it is skipped."""

    name: str
    remedy: str
    measure: Callable[..., Measured]
    needs: tuple[str, ...] = ()


class Result(NamedTuple):
    """The result of one check."""

    name: str
    status: str  # ok, FAILED or skipped
    value: str  # or the reason why it was skipped
    limit: str
    remedy: str

    def in_words(self) -> str:
        """One line for the operator."""
        limit = f", limit {self.limit}" if self.limit else ""
        remedy = f"; {self.remedy}" if self.status == FAILED else ""
        return f"{self.status:<8} {self.name:<19} {self.value}{limit}{remedy}"


class Conformance(NamedTuple):
    """The results of all checks."""

    rig: str
    seconds: float
    checks: list[Result]

    @in_json
    def ok(self) -> bool:
        """Whether no check failed."""
        return not self.failed

    @property
    def failed(self) -> list[str]:
        """Names of the failed checks."""
        return [row.name for row in self.checks if row.status == FAILED]

    def in_words(self) -> list[str]:
        """Lines for the operator."""
        count = {status: sum(row.status == status for row in self.checks) for status in (OK, FAILED, SKIPPED)}
        total = f"{len(self.checks)} checks in {self.seconds:.0f} s: {count[OK]} ok, {count[FAILED]} failed"
        return [
            *(row.in_words() for row in self.checks),
            f"checks   {self.rig}: {total}, {count[SKIPPED]} not possible here",
        ]

    def junit(self) -> str:
        """The results as JUnit XML."""
        numbers = {"tests": len(self.checks), "failures": len(self.failed)}
        numbers["skipped"] = sum(row.status == SKIPPED for row in self.checks)
        texts = {key: str(value) for key, value in numbers.items()} | {"errors": "0", "time": f"{self.seconds:.3f}"}
        suite = Xml.Element("testsuite", {"name": f"rig conformance {self.rig}"} | texts)
        for row in self.checks:
            case = Xml.SubElement(suite, "testcase", {"classname": "rig.conformance", "name": row.name, "time": "0"})
            if row.status == FAILED:
                Xml.SubElement(case, "failure", {"message": f"{row.value}, limit {row.limit}"}).text = row.remedy
            elif row.status == SKIPPED:
                Xml.SubElement(case, "skipped", {"message": row.value})
        return Xml.tostring(suite, encoding="unicode", xml_declaration=True) + "\n"


def judged(checks: tuple[Check, ...], session: object) -> list[Result]:
    """The results of checks in their order, each with the session."""
    results: dict[str, Result] = {}
    for check in checks:
        missing = [name for name in check.needs if results[name].status != OK]
        if missing:
            results[check.name] = Result(check.name, SKIPPED, f"needs {missing[0]}", "", check.remedy)
            continue
        try:
            passed, value, limit = check.measure(session)
            results[check.name] = Result(check.name, OK if passed else FAILED, value, limit, check.remedy)
        except NotSeen as reason:
            results[check.name] = Result(check.name, SKIPPED, str(reason), "", check.remedy)
    return list(results.values())
