"""The bank with every subject, in processes; the result does not depend on their number."""

from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple, TypeVar

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

from bridge.faults import Fault
from bridge.kernel_cache import compile_once
from cockpit.bank import rules
from cockpit.bank.figures import Figures, figures, refused
from cockpit.bank.least import Least, least
from cockpit.bank.oracle import ask
from cockpit.bank.run import Curves, Judged, Subject, judge, wrong_from
from cockpit.bank.scenario import BankScenario

R = TypeVar("R")
_ASKED = {"helped", "cannot-help"}  # of which the oracle says whether any controller could do better


class Done(NamedTuple):
    """One run of the bank."""

    figures: Figures
    judged: Judged | None  # with curves, of a run of the controller that fails or slips
    oracle: Curves | None = None  # of the oracle when the run first slips; None where it never does
    first_s: tuple[float, float] | None = None  # when that slip or surge begins, and how long it lasts


def warm_up(scenario: BankScenario) -> None:
    """Compile or load the kernels before the processes begin, each of which would."""
    short = scenario._replace(table=scenario.table | {"duration_s": 2.0 * scenario.rig.solver.block_s})
    compile_once("the bench of the controller", lambda: judge(short, Subject(rules.NONE)))


def run_one(scenario: BankScenario, rule: int) -> Done:
    """One scenario with one subject; a scenario that the controller refuses is a failure, not a fault."""
    subject = Subject(rule)
    own = rule == rules.CONTROLLER
    try:
        judged = judge(scenario, subject)
    except Fault as fault:
        if not own:
            raise
        return Done(refused(scenario, subject.name, fault.line), None)
    found = figures(scenario, subject.name, judged, own)
    if own and found.expect in _ASKED and found.slips_from_enabling:
        return _beside_oracle(scenario, found, judged)
    return Done(found, judged if found.failures else None)


def _beside_oracle(scenario: BankScenario, found: Figures, judged: Judged) -> Done:
    """A run with slips or surges, and whether any controller could be without: those that count, else all from enabling on."""
    fails = found.expect == "helped" and found.slips + found.surges > 0
    from_s = found.counted_from_s if fails else scenario.enabled_from_s
    wrong = judged.events[wrong_from(judged.events, from_s)]
    first_s = float(wrong[0, 1]), float(wrong[0, 2] - wrong[0, 1])
    oracle, curves = ask(scenario, len(wrong), from_s, first_s[0])
    told = [oracle.in_words(len(wrong))] if fails else []
    failures = [*found.failures[:1], *told, *found.failures[1:]]  # the first tells of the slips
    return Done(found._replace(failures=failures, oracle=oracle), judged, curves, first_s)


def run_bank(
    bank: Sequence[BankScenario], subjects: Sequence[int], jobs: int, progress: Callable[[float, str], None]
) -> list[Done]:
    """All runs, scenario by scenario with every subject of it.

    Args:
        subjects: rules of `cockpit.bank.rules`.
        progress: called with the share done and a line on what was done last.

    """
    plan = [
        (scenario, rule) for scenario in bank for rule in subjects if rule == rules.CONTROLLER or scenario.ever_enabled
    ]
    length_s = sum(scenario.duration_s for scenario, _ in plan)
    done: list[Done] = []
    spent_s = 0.0
    for one, (scenario, _) in zip(_each(run_one, plan, jobs), plan, strict=True):
        done.append(one)
        spent_s += scenario.duration_s
        told = f"{one.figures.scenario}, {one.figures.subject}"
        progress(spent_s / length_s, told + (": " + "; ".join(one.figures.failures) if one.figures.failures else ""))
    return done


def find_least(bank: Sequence[BankScenario], jobs: int, progress: Callable[[float, str], None]) -> dict[str, Least]:
    """The least constant ratios of scenarios, by name."""
    found: dict[str, Least] = {}
    for one, ratio in zip(bank, _each(least, [(one,) for one in bank], jobs), strict=True):
        found[one.name] = ratio
        told = f"{one.name}: least constant v_a / v_d {ratio.from_one:.2f}, {ratio.of_all:.2f} without the floor of 1"
        progress(len(found) / len(bank), told)
    return found


def _each(function: Callable[..., R], items: Sequence[tuple[Any, ...]], jobs: int) -> Iterator[R]:
    """`function(*item)` for every item, in their order, in `jobs` processes."""
    if jobs == 1:
        yield from (function(*item) for item in items)
        return
    parallel: Any = Parallel(n_jobs=jobs, max_nbytes=None, return_as="generator")
    yield from parallel(delayed(function)(*item) for item in items)
