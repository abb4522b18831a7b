"""Runs made from the plant and made ready for comparison: what the tests of the diagnosis' parts have in common."""

from pathlib import Path

from diagnosis.evidence import Evidence, load_evidence
from diagnosis.making import Case, make_evidence
from diagnosis.problem import Prepared, prepare


def prepared(folder: Path, protocol: str, effects=None, seed: int = 1) -> tuple[Evidence, list[Prepared]]:
    """A rig that is as described but for `effects` and what every rig differs by."""
    make_evidence(folder, Case(protocol, effects=effects or {}, drawn=False), seed)
    evidence = load_evidence(folder)
    return evidence, prepare(evidence)
