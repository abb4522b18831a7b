"""All evidences of one folder, as numbers that a file can keep."""

import math
from typing import Any, NamedTuple

from bench.judge.columns import blocks
from bench.judge.linear.witnessed import Ledger, Row, ledger_of
from bench.judge.linear.witnesses import beyond_library, evidence_of, speaking
from bench.judge.lines import evidences
from bench.judge.simulated.witnesses import waves
from bridge.faults import Fault
from diagnosis.evidence.run import Evidence
from diagnosis.gap.prepare import Prepared, prepare
from diagnosis.hypotheses.catalogue import cannot_show
from diagnosis.model.rig import Roughness
from diagnosis.relations.answer import Answered, relations_of
from diagnosis.relations.decide import decision_of
from plant.effects.library import EFFECTS

Names = frozenset[str]
Places = dict[str, dict[str, float]]  # log evidence by effect, at each place of a witness


class Seen(NamedTuple):
    """The evidences of one folder."""

    possible: tuple[str, ...]  # effects that the runs can show
    ledger: Ledger | None  # of the simulated rig; None where it shows none of the measured features
    related: dict[str, float]  # log evidence of the relations by effect
    lines: Places
    free: dict[str, float]  # log evidence of a free function at each place of the straight lines
    waves: Places
    chosen: Places  # evidence that each relation loses without a cause that it has chosen
    beyond: float  # share of the content of a relation that nothing in the library takes
    foreign: bool  # whether a run has a vibration that no effect makes

    def without(self, effect: str) -> "Seen":
        """The evidences of a library that lacks an effect."""

        def left(values: dict[str, float]) -> dict[str, float]:
            return {name: value for name, value in values.items() if name != effect}

        def of_each(places: Places) -> Places:
            return {place: left(values) for place, values in places.items()}

        ledger = self.ledger
        if ledger is not None:
            ledger = ledger._replace(rows=tuple(row for row in ledger.rows if effect not in row.names))
        return self._replace(
            possible=tuple(name for name in self.possible if name != effect),
            ledger=ledger,
            related=left(self.related),
            lines=of_each(self.lines),
            waves=of_each(self.waves),
            chosen=of_each(self.chosen),
        )


def seen_of(evidence: Evidence) -> Seen:
    """Fit, predict and regress: 20 s of CPU."""
    runs = prepare(evidence)
    fitted = [run for run in runs if not run.holdout]
    relations = relations_of(evidence.rig, runs)
    hidden = cannot_show(evidence.rig, runs, evidence.assumed)
    possible = tuple(name for name in EFFECTS if name not in hidden)
    answered = speaking(relations.answered, evidence.rig)
    lines = {block.name: evidences(block) for block in blocks(evidence.rig, fitted)}
    try:
        ledger = ledger_of(evidence, relations)
    except Fault:
        ledger = None
    return Seen(
        possible,
        ledger,
        {name: evidence_of(answered, frozenset((name,))) for name in possible},
        {place: by_effect for place, (by_effect, _) in lines.items()},
        {place: free for place, (_, free) in lines.items() if math.isfinite(free)},
        _waves(evidence, fitted),
        {each.name: _lost(each) for each in relations.answered},
        beyond_library(relations.answered, decision_of(relations, evidence.rig).outside),
        any(run.foreign for run in evidence.runs),
    )


def _waves(evidence: Evidence, runs: list[Prepared]) -> Places:
    places: Places = {}
    for place, name, value in waves(evidence.rig, runs):
        places.setdefault(place, {})[name] = value
    return places


def _lost(answered: Answered) -> dict[str, float]:
    return {term.cause: lost for term, lost in zip(answered.chosen.terms, answered.lost, strict=True)}


def as_table(seen: Seen) -> dict[str, Any]:
    """For a JSON file."""
    table = seen._asdict()
    if seen.ledger is not None:
        rows = [row._asdict() | {"names": sorted(row.names)} for row in seen.ledger.rows]
        table["ledger"] = seen.ledger._asdict() | {"rows": rows, "surface": list(seen.ledger.surface)}
    return table


def from_table(table: dict[str, Any]) -> Seen:
    """From a JSON file."""
    changed: dict[str, Any] = {"possible": tuple(table["possible"])}
    if table["ledger"] is not None:
        rows = tuple(Row(**(row | {"names": frozenset(row["names"])})) for row in table["ledger"]["rows"])
        surface = Roughness(*table["ledger"]["surface"])
        changed["ledger"] = Ledger(**(table["ledger"] | {"rows": rows, "surface": surface}))
    return Seen(**(table | changed))
