"""Relations in an answer: shares of the difference, the remainder, refitted numbers, a picture."""

from collections.abc import Sequence

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.prepare import Prepared
from diagnosis.latent.answer import LatentSignal
from diagnosis.relations.answer import Answered, Relations
from diagnosis.relations.decide import Decision
from diagnosis.report.latent_block import latent_findings, latent_remainder, latent_rows, latent_shares
from diagnosis.report.summary import summary
from diagnosis.result import (
    Curve,
    Diagnosis,
    LeftOut,
    Picture,
    RelationNumber,
    RelationRow,
    Remainder,
    Share,
)

_SIGNALS = {"spring": "spring relation", "motion": "motion relation", "drive": "drive relation"}
_POINTS = 1500  # most points of a curve
_TWO_SIDED_90 = 1.645


def with_relations(
    done: Diagnosis,
    rig: RigTable,
    runs: list[Prepared],
    relations: Relations,
    decision: Decision,
    latent: Sequence[LatentSignal],
) -> Diagnosis:
    """The diagnosis with shares, remainder, numbers and picture of relations and latent friction, and with its sentences."""
    complete = done._replace(
        shares=(*(share for answered in relations.answered for share in _shares(answered)), *latent_shares(latent)),
        remainder=_remainder(relations, decision) or latent_remainder(latent),
        relations=(
            *(
                RelationRow(
                    signal_of(answered.name),
                    answered.unit,
                    answered.described,
                    answered.refitted,
                    answered.left,
                    answered.noise,
                    answered.chosen.causes,
                )
                for answered in relations.answered
            ),
            *latent_rows(latent),
        ),
        findings=(*done.findings, *latent_findings(latent)),
        left_out=tuple(LeftOut(signal_of(missing.name), missing.why) for missing in relations.missing),
        numbers=tuple(number for answered in relations.answered for number in _numbers(answered, rig)),
        pictures=(*_pictures(relations, runs), *done.pictures),
    )
    return complete._replace(summary=summary(complete))


def signal_of(relation: str) -> str:
    """The name of a relation in the format of the diagnosis."""
    return _SIGNALS.get(relation, relation)


def in_a_line(decision: Decision) -> str:
    """The decision of the relations as a progress message; empty without a decision."""
    if decision.outside:
        first = decision.outside[0]
        return f"{signal_of(first.relation)}: {first.what}, which no effect of the library causes"
    if decision.decided:
        first = decision.decided[0]
        return f"{signal_of(first.relation)}: {first.cause}"
    return ""


def _shares(answered: Answered) -> list[Share]:
    if answered.shares is None:
        return []
    signal = signal_of(answered.name)
    shares = [
        Share(signal, cause.cause, cause.share, cause.interval_90, cause.null_90) for cause in answered.shares.causes
    ]
    return [
        *shares,
        Share(signal, "noise", answered.shares.noise, None, None),
        Share(signal, "unexplained", answered.shares.unexplained, answered.shares.unexplained_90, None),
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


def _numbers(answered: Answered, rig: RigTable) -> list[RelationNumber]:
    known = rig.values()
    extra = {"drive-stiffness": "drive_stiffness_N_per_m", "drive-damping": "drive_damping_Ns_per_m"}
    moved: dict[str, tuple[float, float]] = {}
    for name, size, deviation in answered.nuisances:
        if name in known:
            moved[name] = (size, deviation)
    for term, sizes, deviations in zip(
        answered.chosen.terms, answered.chosen.sizes, answered.chosen.deviations, strict=True
    ):
        name = extra.get(term.cause)
        if name is not None:
            before = moved.get(name, (0.0, 0.0))
            moved[name] = (before[0] + float(sizes[0]), float(np.hypot(before[1], deviations[0])))
    numbers: list[RelationNumber] = []
    for name, (size, deviation) in moved.items():
        described = known[name] or 0.0
        half = _TWO_SIDED_90 * deviation
        value = described + size
        numbers.append(RelationNumber(name, signal_of(answered.name), described, value, (value - half, value + half)))
    return numbers


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
    unit = f" / {worst.unit}" if worst.unit else ""
    title = f"Residual of the {signal_of(worst.name)} in {run}"
    return [Picture("residual", title, "time / s", f"left{unit}", tuple(curves))]
