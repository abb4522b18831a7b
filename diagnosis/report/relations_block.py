"""Relations and latent friction in an answer: shares, the remainder, sizes, a picture."""

from collections.abc import Sequence

import numpy as np

from bridge.log.finding import Finding
from diagnosis.gap.prepare import Prepared
from diagnosis.judge.witnesses import Witnesses
from diagnosis.latent.answer import LatentSignal
from diagnosis.latent.causes import SCATTER
from diagnosis.relations.answer import Answered, Relations
from diagnosis.relations.decide import Decision
from diagnosis.report.summary import summary
from diagnosis.report.words import SLOW, SLOWLY
from diagnosis.result import (
    Curve,
    Diagnosis,
    LeftOut,
    Picture,
    RelationRow,
    Remainder,
    Share,
)

_SIGNALS = {"spring": "spring relation", "motion": "motion relation", "drive": "drive relation"}
_POINTS = 1500  # most points of a curve


def with_relations(done: Diagnosis, seen: Witnesses) -> Diagnosis:
    """The diagnosis with shares, remainder and picture of relations and latent friction, and with its sentences."""
    relations, decision, latent = seen.relations, seen.decision, seen.latent
    answered, missing = relations
    complete = done._replace(
        shares=(*(share for relation in answered for share in _shares(relation)), *latent_shares(latent)),
        remainder=_remainder(relations, decision) or _latent_remainder(latent),
        relations=(*map(_row, answered), *latent_rows(latent)),
        findings=(*done.findings, *_latent_findings(latent)),
        left_out=tuple(LeftOut(signal_of(relation.name), relation.why) for relation in missing),
        pictures=(*_pictures(relations, seen.runs), *done.pictures),
    )
    return complete._replace(summary=summary(complete))


def _row(answered: Answered) -> RelationRow:
    sizes = answered.described, answered.refitted, answered.left, answered.noise
    return RelationRow(signal_of(answered.name), answered.unit, *sizes, answered.chosen.causes)


def signal_of(relation: str) -> str:
    """The name of a relation in the format of the diagnosis."""
    return _SIGNALS.get(relation, relation)


def _shares(answered: Answered) -> list[Share]:
    if answered.shares is None:
        return []
    signal, shares = signal_of(answered.name), answered.shares
    return [
        *(Share(signal, cause.cause, cause.share, cause.interval_90, cause.null_90) for cause in shares.causes),
        Share(signal, "noise", shares.noise, None, None),
        Share(signal, "unexplained", shares.unexplained, shares.unexplained_90, None),
    ]


def _remainder(relations: Relations, decision: Decision) -> Remainder | None:
    """The unexplained pattern with the most evidence, or the relation with the largest unexplained share."""
    by_name = {answered.name: answered for answered in relations.answered}
    if decision.outside:
        first = decision.outside[0]
        shares = by_name[first.relation].shares
        share = None if shares is None else shares.unexplained
        return Remainder(share, signal_of(first.relation), first.what, first.size, first.noise, first.unit)
    if not by_name:
        return None
    worst = max(relations.answered, key=lambda answered: answered.left / answered.noise)
    size = float(np.sqrt(max(worst.left**2 - worst.noise**2, 0.0)))
    share = None if worst.shares is None else worst.shares.unexplained
    return Remainder(share, signal_of(worst.name), "", size, worst.noise, worst.unit)


def _pictures(relations: Relations, runs: list[Prepared]) -> list[Picture]:
    """The residual that exceeds its noise most, with and without its causes, over time."""
    if not relations.answered:
        return []
    worst = max(relations.answered, key=lambda answered: answered.refitted / answered.noise)
    trace = worst.trace
    thin = slice(None, None, max(len(trace.t_s) // _POINTS, 1))
    curves = [Curve("rig without effects, refitted", trace.t_s[thin], trace.without[thin], "retuned")]
    if worst.chosen.terms:
        label = "with " + " and ".join(dict.fromkeys(worst.chosen.causes))
        curves.append(Curve(label, trace.t_s[thin], trace.with_causes[thin], "effect"))
    run = runs[trace.run].file.rsplit(".", 1)[0]
    unit = f" [{worst.unit}]" if worst.unit else ""
    title = f"Residual of the {signal_of(worst.name)} in {run}"
    return [Picture("residual", title, "time [s]", f"residual{unit}", tuple(curves))]


def latent_shares(latent: Sequence[LatentSignal]) -> tuple[Share, ...]:
    """The shares of every signal, in the format of the diagnosis."""
    return tuple(
        Share(signal.signal, share.what, share.share, share.interval_90, share.null_90)
        for signal in latent
        for share in signal.shares
    )


def latent_rows(latent: Sequence[LatentSignal]) -> tuple[RelationRow, ...]:
    """Sizes of the difference and the noise in every signal."""
    return tuple(
        RelationRow(
            signal.signal,
            "N",
            signal.described,
            signal.differs,
            signal.left,
            signal.noise,
            tuple(share.what for share in signal.shares if share.beyond_chance),
        )
        for signal in latent
    )


def _latent_remainder(latent: Sequence[LatentSignal]) -> Remainder | None:
    """The largest part of a signal that no cause predicts."""
    if not latent:
        return None
    worst = max(latent, key=lambda signal: signal.left)
    share = sum(share.share for share in worst.shares if share.what == SCATTER)
    return Remainder(share, worst.signal, "", worst.left, worst.noise, "N")


def _latent_findings(latent: Sequence[LatentSignal]) -> tuple[Finding, ...]:
    """A finding for each signal that no cause predicts and that varies slowly."""
    return tuple(Finding(SLOW, signal.signal, SLOWLY) for signal in latent if signal.varies_slowly)
