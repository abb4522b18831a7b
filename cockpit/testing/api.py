"""The rig of a test in Python, as the fixture `rig` of pytest gives it: a scenario, its runs, and their expectations."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, TypedDict

from typing_extensions import Unpack

from bridge.arrays import Floats
from bridge.config import validate
from bridge.faults import Fault
from bridge.log.logfile import read_run
from cockpit.expect.judge import PASSED, Expected, judge
from cockpit.expect.record import Record, Samples
from cockpit.expect.tables import ExpectTable, refuse_word
from cockpit.figures.signals import SIGNALS
from cockpit.run.device_run import DeviceRun
from cockpit.run.scenario import Scenario
from cockpit.run.scenario_file import in_toml, read_scenario
from cockpit.testing.picture import picture
from cockpit.testing.target import Target, load


class Expectation(TypedDict, total=False):
    """The keys of a table `[[expect]]`."""

    name: str
    requirement: str
    signal: str
    within: tuple[float | str, float | str]
    at_least: float | str
    at_most: float | str
    event: str | Sequence[str]
    within_s: float
    state: str
    is_in: str | Sequence[str]
    slips: int | tuple[int, int]
    surges: int | tuple[int, int]
    from_s: float
    to_s: float
    until_s: float
    never: bool
    in_charge: bool


class Run:
    """A finished run of a rig.

    Args:
        log: its log.
        tables: its configuration.

    """

    def __init__(self, log: Path, tables: Scenario | DeviceRun) -> None:
        self.log, self.tables = log, tables
        self._record = Record(read_run(log), tables.duration_s)
        self.results: list[Expected] = []  # of all judged expectations
        self._tables: list[ExpectTable] = []

    @property
    def checksum(self) -> str:
        """SHA-256 of its log."""
        return self._record.run.checksums.sha256

    @property
    def events(self) -> dict[str, list[float]]:
        """Times [s] of each event, cause and lasting reason of the run, in the words of `stickslip explain`."""
        return self._record.events

    def __getitem__(self, signal: str) -> Floats:
        """Samples of a signal in the SI unit of its name; NaN where it is unknown. Raises Fault CONFIG without any."""
        samples = self._samples(signal)
        values = samples.values.copy()
        values[~samples.known] = float("nan")
        return values

    def t_s(self, signal: str) -> Floats:
        """Times of the samples of a signal."""
        return self._samples(signal).t_s

    def _samples(self, signal: str) -> Samples:
        try:
            refuse_word("signal", signal, SIGNALS)
        except ValueError as error:
            raise Fault("CONFIG", str(error)) from None
        samples = self._record.samples(signal)
        if samples is None:
            raise Fault("CONFIG", f"{signal}: is not in the log of this run; choose another signal")
        return samples

    def picture(self) -> str:
        """The judged expectation that decides, on its signal, as SVG; empty without one."""
        return picture(self._record, self._tables, self.results)

    def expect(self, **keys: Unpack[Expectation]) -> None:
        """Judge an expectation; without keys all of the scenario. Raises AssertionError where one is FAILED or UNTESTED."""
        __tracebackhide__ = True
        tables = self.tables.expect
        if keys:
            tables = [validate(ExpectTable, dict(keys), "expect")]
            if late := tables[0].after(self.tables.duration_s):
                line = f"expect.{late}: must not be after the end of the run, {self.tables.duration_s:g} s"
                raise Fault("CONFIG", f"{line}; set an earlier time, or run longer")
        if not tables:
            raise Fault("CONFIG", "the scenario has no [[expect]]; give a signal, event, state, slips or surges")
        results = judge(self._record, tables)
        self.results += results
        self._tables += tables
        wrong = [result.in_words() for result in results if result.result != PASSED]
        assert not wrong, "\n".join(wrong)  # noqa: S101


class Rig:
    """A rig with the scenario of a test; each run begins from rest.

    Args:
        scenario: a scenario by name or path.
        settings: `key=value` each, as of `--set`.
        target: its rig.
        folder: for the logs of its runs.
        runs: receives each finished run.

    """

    def __init__(self, scenario: str, settings: list[str], target: Target, folder: Path, runs: list[Run]) -> None:
        self._scenario, self._settings, self._target = scenario, settings, target
        self._folder, self._runs = folder, runs
        given = read_scenario(scenario)[1]
        self._changes: dict[str, list[dict[str, Any]]] = {name: list(given.get(name, [])) for name in ("fault", "step")}

    def fault(
        self,
        kind: str,
        target: str,
        *,
        from_s: float = 0.0,
        for_s: float = 0.0,
        value: float | None = None,
        other: str | None = None,
    ) -> None:
        """Add a fault to the runs that follow, as a table `[[fault]]` does (`stickslip fault --list`)."""
        given = {"kind": kind, "target": target, "from_s": from_s, "for_s": for_s, "value": value, "other": other}
        self._add("fault", given)

    def step(
        self,
        at_s: float,
        *,
        command: str | None = None,
        settings: Sequence[str] | None = None,
        speed_mps: float | None = None,
        ramp_s: float | None = None,
        load: float | None = None,
    ) -> None:
        """Add a change to the runs that follow, as a table `[[step]]` does."""
        given = {"at_s": at_s, "command": command, "settings": settings, "speed_mps": speed_mps, "ramp_s": ramp_s}
        self._add("step", given | {"load": load})

    def _add(self, table: str, given: dict[str, Any]) -> None:
        row = {key: value for key, value in given.items() if value is not None}
        self._changes[table].append(row)
        self._settings = [*self._settings, f"{table}={in_toml(self._changes[table])}"]

    def run(self, seconds: float | None = None) -> Run:
        """Run for a time; not given: as long as the scenario. Raises Fault."""
        timed = [] if seconds is None else [f"duration_s={float(seconds)!r}"]
        test = load(self._scenario, [*self._settings, *timed], self._target)
        log = self._folder / f"{len(self._runs) + 1}.mcap"
        test.make(self._scenario, log)
        self._runs.append(Run(log, test.run))
        return self._runs[-1]
