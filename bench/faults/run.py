"""Many entries of the catalogue, in processes; the result does not depend on their number."""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from typing import Any, NamedTuple

from joblib import Parallel, delayed  # pyright: ignore[reportUnknownVariableType]

from bench.faults.judge import SAFE, SILENT, UNSAFE, Outcome, judge
from bridge.faults import Fault
from bridge.kernel_cache import compile_once
from bridge.results import in_json
from bridge.units import counted
from cockpit.faults.catalogue import CatalogueEntry


class FaultBench(NamedTuple):
    """Every outcome, in the order of the catalogue."""

    outcomes: list[Outcome]

    @in_json
    def counts(self) -> dict[str, int]:
        """Number of entries by verdict."""
        counts = Counter(outcome.verdict for outcome in self.outcomes)
        return {verdict: counts[verdict] for verdict in (SAFE, SILENT, UNSAFE)}

    @property
    def worse(self) -> list[Outcome]:
        """Entries worse than their known verdict."""
        return [outcome for outcome in self.outcomes if not outcome.as_known]

    @in_json
    def worse_than_known(self) -> list[str]:
        """Names of the entries that are worse than their known verdict."""
        return [outcome.name for outcome in self.worse]

    def in_words(self) -> list[str]:
        """Lines of text: the counts, and each entry that is not safe."""
        counts = ", ".join(f"{count} {verdict}" for verdict, count in self.counts.items())
        lines = [f"faults   {counted(len(self.outcomes), 'fault')}: {counts}"]
        lines += [f"{row.verdict:<8} {row.name}: {row.why}" for row in self.outcomes if row.verdict != SAFE]
        return lines + [f"WORSE    {bad.name}: is {bad.verdict}, must be {bad.known}" for bad in self.worse]


def chosen(catalogue: Sequence[CatalogueEntry], only: Sequence[str]) -> list[CatalogueEntry]:
    """Entries by group or by start of the name; all without a selection. Raises Fault CONFIG."""

    def fits(named: CatalogueEntry, word: str) -> bool:
        return named.group == word or named.name.startswith(word)

    for word in only:
        if not any(fits(named, word) for named in catalogue):
            groups = ", ".join(dict.fromkeys(named.group for named in catalogue))
            raise Fault("CONFIG", f"--only {word}: no such group or entry; groups: {groups}")
    return [named for named in catalogue if not only or any(fits(named, word) for word in only)]


def bench(catalogue: Sequence[CatalogueEntry], jobs: int, progress: Callable[[float, str], None]) -> FaultBench:
    """Judge entries in simulated time.

    Args:
        catalogue: the entries.
        jobs: number of processes.
        progress: called with the share done and a line on the last entry.

    """
    plan = list(catalogue)
    if plan and jobs > 1:
        compile_once("the bench of faults", lambda: judge(plan[0]))
    done: list[Outcome] = []
    for outcome in _each(plan, jobs):
        done.append(outcome)
        progress(len(done) / len(plan), f"{outcome.name}: {outcome.verdict}, {outcome.why}")
    return FaultBench(done)


def _each(plan: Sequence[CatalogueEntry], jobs: int) -> Iterator[Outcome]:
    if jobs == 1:
        yield from map(judge, plan)
        return
    parallel: Any = Parallel(n_jobs=jobs, return_as="generator")
    yield from parallel(delayed(judge)(case) for case in plan)
