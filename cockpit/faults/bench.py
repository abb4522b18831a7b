"""Many entries of the catalogue, in processes; the result does not depend on their number."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

from bridge.faults import Fault
from bridge.kernel_cache import compile_once
from bridge.units import counted
from cockpit.faults.catalogue import Named
from cockpit.faults.judge import SAFE, SILENT, UNSAFE, Outcome, judge, refused


class FaultBench(NamedTuple):
    """Every outcome, in the order of the catalogue."""

    outcomes: list[Outcome]

    @property
    def counts(self) -> dict[str, int]:
        """How many of each verdict."""
        counts = Counter(one.verdict for one in self.outcomes)
        return {verdict: counts[verdict] for verdict in (SAFE, SILENT, UNSAFE)}

    @property
    def worse(self) -> list[Outcome]:
        """Those that are worse than is known."""
        return [one for one in self.outcomes if not one.as_known]

    def as_json(self) -> dict[str, Any]:
        """For `--json`."""
        worse = [one.name for one in self.worse]
        return {"outcomes": self.outcomes, "counts": self.counts, "worse_than_known": worse}

    def in_words(self) -> list[str]:
        """Lines for a person: the counts, and each that is not safe."""
        told = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items())
        lines = [f"faults   {counted(len(self.outcomes), 'fault')}: {told}"]
        lines += [f"{one.verdict:<8} {one.name}: {one.why}" for one in self.outcomes if one.verdict != SAFE]
        return lines + [f"WORSE    {one.name}: is {one.verdict}, must be {one.open or SAFE}" for one in self.worse]


def judge_one(one: Named) -> Outcome:
    """One entry; a scenario that nobody takes is a finding, not a fault of the bench."""
    try:
        return judge(one)
    except Fault as fault:
        return refused(one, fault)


def bench(catalogue: Sequence[Named], jobs: int, progress: Callable[[float, str], None]) -> FaultBench:
    """Judge entries in simulated time.

    Args:
        catalogue: the entries.
        jobs: processes.
        progress: called with the share done and a line on what was done last.

    """
    plan = list(catalogue)
    if plan and jobs > 1:
        compile_once("the bench of faults", lambda: judge_one(_short(plan[0])))
    done: list[Outcome] = []
    for outcome in _each(plan, jobs):
        done.append(outcome)
        progress(len(done) / len(plan), f"{outcome.name}: {outcome.verdict}, {outcome.why}")
    return FaultBench(done)


def _short(one: Named) -> Named:
    return one.model_copy(update={"entry": one.entry.model_copy(update={"begin_s": 0.05, "watch_s": 0.05})})


def _each(plan: Sequence[Named], jobs: int) -> Iterator[Outcome]:
    if jobs == 1:
        yield from map(judge_one, plan)
        return
    parallel: Any = Parallel(n_jobs=jobs, return_as="generator")
    yield from parallel(delayed(judge_one)(one) for one in plan)
