"""`python -m bench control`: the bank run and judged, as a result, as JSON and in words."""

import time
from collections import Counter
from collections.abc import Callable, Sequence
from typing import NamedTuple

from bench.control import rules
from bench.control.bars import Bar, bars
from bench.control.cost import step_cost_ratio
from bench.control.figures import Figures
from bench.control.oracle import Least
from bench.control.scenario import BankScenario
from bench.control.suite import Done, find_least, run_bank, warm_up
from bridge.results import in_json
from bridge.units import counted

OWN = rules.NAMES[rules.CONTROLLER]
_WIDTH = 2 + max(map(len, rules.NAMES.values()))  # width of the column with the names of controller and rivals


class BankResult(NamedTuple):
    """The table of bars, every run, and the elapsed time."""

    bars: list[Bar]
    done: list[Done]
    least: dict[str, Least]  # least constant v_a / v_d of the long scenarios, by name
    step_cost_ratio: float
    scenarios: list[BankScenario]
    elapsed_s: float
    JSON_HIDDEN = "done", "scenarios"

    @in_json
    def passed(self) -> bool:
        """Whether no bar is missed."""
        return all(bar.holds is not False for bar in self.bars)

    @property
    def failed(self) -> list[Done]:
        """The runs of the controller that miss a bar."""
        return [run for run in self.done if run.figures.failures]

    @property
    def explained(self) -> list[Done]:
        """The controller's runs with slips or surges that miss no bar: the exciter had not started yet or is too weak."""
        return [run for run in self.done if run.figures.oracle is not None and not run.figures.failures]

    @in_json
    def runs(self) -> list[Figures]:
        """The figures of every run."""
        return [run.figures for run in self.done]


def bench(bank: Sequence[BankScenario], rivals: bool, jobs: int, progress: Callable[[float, str], None]) -> BankResult:
    """Run the controller, and its rivals if asked for, on these scenarios."""
    started_s = time.perf_counter()
    warm_up(bank[0])
    cost = step_cost_ratio()
    subjects = (rules.CONTROLLER, *(rules.RIVALS if rivals else ()))
    done = run_bank(bank, subjects, jobs, progress)
    long = {run.figures.scenario for run in done if run.figures.settled_ratio >= 0.0 and run.figures.expect == "helped"}
    least = find_least([scenario for scenario in bank if scenario.name in long], jobs, progress)
    table = bars([run.figures for run in done], least, cost, OWN)
    return BankResult(table, done, least, cost, list(bank), time.perf_counter() - started_s)


def in_words(result: BankResult) -> list[str]:
    """The table, then a line for each run that misses a bar."""
    lines: list[str] = []
    for bar in result.bars:
        mark = {True: "holds", False: "MISSED", None: "-"}[bar.holds]
        lines.append(f"{mark:<7}{bar.name:<54}{bar.bar}")
        lines.extend(f"{'':<9}{name:<{_WIDTH}}{value}" for name, value in bar.values.items())
    for run in result.failed:
        lines.extend(f"{run.figures.scenario:<32}{line}" for line in run.figures.failures)
    if explained := result.explained:
        verdicts = Counter(run.figures.oracle.verdict for run in explained if run.figures.oracle is not None)
        words = "; ".join(f"{count} {verdict}" for verdict, count in verdicts.items())
        lines.append(f"{counted(len(explained), 'run')} with slips that count as no failure: {words}")
    missed = sum(bar.holds is False for bar in result.bars)
    simulated_s = sum(run.figures.duration_s for run in result.done)
    lines.append(
        f"{len(result.scenarios)} scenarios, {missed} of {len(result.bars)} bars missed; {simulated_s:.0f} s simulated in "
        f"{result.elapsed_s:.0f} s"
    )
    return lines
