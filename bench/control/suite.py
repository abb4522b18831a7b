"""The bank with every subject, in processes; the result does not depend on their number."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

from bench.control import rules
from bench.control.figures import Figures, figures, refused
from bench.control.oracle import Least, ask, least
from bench.control.run import Curves, Judged, Subject, judge, wrong_from
from bench.control.scenario import BankScenario
from bench.control.trust.reports import Reports
from bridge.faults import Fault
from bridge.kernel_cache import compile_once

R = TypeVar("R")
_ASKED = {"helped", "cannot-help"}  # the oracle shows whether any controller could slip less there


class Done(NamedTuple):
    """One run of the bank."""

    figures: Figures
    judged: Judged | None  # events and curves of a run that fails or slips; None for the other runs
    oracle: Curves | None = None  # the oracle's, at the first slip or surge of the run; None if not run
    first_s: tuple[float, float] | None = None  # begin and duration of that slip or surge


def warm_up(scenario: BankScenario) -> None:
    """Compile or load the kernels once, before the processes begin: each process would compile them."""
    short = scenario._replace(table=scenario.table | {"duration_s": 2.0 * scenario.rig.solver.block_s})
    compile_once("the bench of the controller", lambda: judge(short, Subject(rules.NONE)))


def run_one(scenario: BankScenario, rule: int) -> Done:
    """One scenario with one subject; a scenario that the controller refuses is a failure, not a fault."""
    subject = Subject(rule)
    by_controller = rule == rules.CONTROLLER
    reports = Reports()
    try:
        judged = judge(scenario, subject, observe=reports if by_controller else lambda _: None)
    except Fault as fault:
        if not by_controller:
            raise
        return Done(refused(scenario, subject.name, fault.line), None)
    result = figures(scenario, subject.name, judged, by_controller)._replace(reports=sorted(reports.codes))
    if by_controller and result.expect in _ASKED and result.slips_from_enabling:
        return _with_oracle(scenario, result, judged)
    return Done(result, judged if result.failures else None)


def _with_oracle(scenario: BankScenario, result: Figures, judged: Judged) -> Done:
    """A run with slips or surges and the oracle's result for them: for those that count, else for all from enabling on."""
    fails = result.expect == "helped" and result.slips + result.surges > 0
    from_s = result.counted_from_s if fails else scenario.enabled_from_s
    wrong = judged.events[wrong_from(judged.events, from_s)]
    first_s = float(wrong[0, 1]), float(wrong[0, 2] - wrong[0, 1])
    oracle, curves = ask(scenario, len(wrong), from_s, first_s[0])
    verdicts = [oracle.in_words(len(wrong))] if fails else []
    failures = [*result.failures[:1], *verdicts, *result.failures[1:]]  # the first line counts the slips
    return Done(result._replace(failures=failures, oracle=oracle), judged, curves, first_s)


def run_bank(
    bank: Sequence[BankScenario], subjects: Sequence[int], jobs: int, progress: Callable[[float, str], None]
) -> list[Done]:
    """Run every scenario with every subject; rivals only where vibration is ever allowed.

    Args:
        subjects: rules of `bench.control.rules`.
        progress: called with the share done and a line on the last run.

    """
    plan = [
        (scenario, rule) for scenario in bank for rule in subjects if rule == rules.CONTROLLER or scenario.ever_enabled
    ]
    length_s = sum(scenario.duration_s for scenario, _ in plan)
    done: list[Done] = []
    spent_s = 0.0
    for run, (scenario, _) in zip(each(run_one, plan, jobs), plan, strict=True):
        done.append(run)
        spent_s += scenario.duration_s
        line = f"{run.figures.scenario}, {run.figures.subject}"
        progress(spent_s / length_s, line + (": " + "; ".join(run.figures.failures) if run.figures.failures else ""))
    return done


def find_least(bank: Sequence[BankScenario], jobs: int, progress: Callable[[float, str], None]) -> dict[str, Least]:
    """The least constant ratios of scenarios, by name."""
    ratios: dict[str, Least] = {}
    for run, ratio in zip(bank, each(least, [(run,) for run in bank], jobs), strict=True):
        ratios[run.name] = ratio
        line = f"{run.name}: least constant v_a / v_d {ratio.from_one:.2f}, {ratio.of_all:.2f} without the floor of 1"
        progress(len(ratios) / len(bank), line)
    return ratios


def each(function: Callable[..., R], items: Sequence[tuple[Any, ...]], jobs: int) -> Iterator[R]:
    """`function(*item)` for every item, in their order, in `jobs` processes."""
    if jobs == 1:
        yield from (function(*item) for item in items)
        return
    parallel: Any = Parallel(n_jobs=jobs, max_nbytes=None, return_as="generator")
    yield from parallel(delayed(function)(*item) for item in items)
