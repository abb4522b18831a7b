"""The answer to an evidence: probabilities of the effects, of `none`, and of an effect that the library lacks."""

from pathlib import Path

from bench.judge.linear.judge import judge
from bench.judge.linear.witnessed import ledger_of
from diagnosis.evidence.folder import load_evidence
from diagnosis.gap.prepare import prepare
from diagnosis.relations.answer import relations_of


def answer(folder: Path, budget_s: float | None) -> dict[str, float]:  # noqa: ARG001
    """Probabilities of the effects and of `none`, which add up to 1, and of `outside`."""
    evidence = load_evidence(folder)
    return judge(ledger_of(evidence, relations_of(evidence.rig, prepare(evidence))))
