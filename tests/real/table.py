"""The figures of one diagnosis, a few lines of text, which docs/quality/results.md quotes."""

from bridge.units import percent, times
from diagnosis.evidence.folder import Evidence
from diagnosis.gap.prepare import prepare
from diagnosis.latent.answer import latent_of
from diagnosis.relations.answer import Answered, relations_of
from diagnosis.relations.decide import decision_of
from diagnosis.report.relations_block import latent_shares
from diagnosis.report.words import estimate_in_words, headline, share_in_words
from diagnosis.result import Diagnosis, Shrinkage

_SHOWN = 4  # candidates


def lines(diagnosis: Diagnosis) -> list[str]:
    """Verdict, candidates with their parameters, gap on the held-out runs, where it lies, seconds."""
    gap = diagnosis.gap
    rows = [f"verdict     {headline(diagnosis)}"]
    for candidate in diagnosis.candidates[:_SHOWN]:
        sizes = "; ".join(estimate_in_words(candidate.effect, *item) for item in candidate.parameters.items())
        rows.append(f"candidate   {candidate.effect} {percent(candidate.probability)}{': ' if sizes else ''}{sizes}")
    rows += [f"alike       {', '.join(group)}" for group in diagnosis.not_distinguishable]
    rows.append(
        f"held out    {times(gap.nominal)} as described, {times(gap.retuned)} retuned, {times(gap.with_effect)} as judged"
    )
    rows += [f"  {_closed(fit)}" for fit in gap.compared]
    rows += [
        f"where       {percent(cell.share)} {cell.signal} {cell.regime} {cell.band_Hz[0]:g}-{cell.band_Hz[1]:g} Hz {cell.run}"
        for cell in diagnosis.where[:3]
    ]
    rows += [
        f"moved       {number.name} {number.described:.4g} -> {number.retuned:.4g}"
        for number in diagnosis.rig
        if abs(number.retuned - number.described) > 2.0 * number.tolerance * (number.described or 1.0)
    ]
    return [*rows, f"next        {diagnosis.next_experiment.what}", f"took        {diagnosis.elapsed_s:.0f} s"]


def of_relations(evidence: Evidence) -> list[str]:
    """The relations between channels: sizes, shares on the held-out runs, omitted relations."""
    runs = prepare(evidence)
    relations = relations_of(evidence.rig, runs)
    rows = [line for item in relations.answered for line in _relation(item)]
    decision = decision_of(relations, evidence.rig)
    rows += [f"{item.relation}: named: {item.cause}" for item in decision.decided]
    rows += [
        f"{item.relation}: outside: {item.what}: {item.size:.3g} {item.unit}, noise {item.noise:.3g}"
        for item in decision.outside
    ]
    return [*rows, *(f"{item.name}: left out: {item.why}" for item in relations.missing)]


def of_latent(evidence: Evidence) -> list[str]:
    """Latent friction: the variation on the held-out runs, and its shares."""
    rows: list[str] = []
    for signal in latent_of(evidence.rig, prepare(evidence)):
        once = "; varies slowly" if signal.varies_slowly else ""
        rows.append(
            f"{signal.signal}: {signal.differs:.3g} N differ in {signal.rows} rows, noise {signal.noise:.2g}{once}"
        )
        rows += [f"  {share_in_words(share)}" for share in latent_shares([signal])]
    return rows


def _relation(one: Answered) -> list[str]:
    sizes = f"{one.described:.3g} {one.unit} described, {one.refitted:.3g} refitted, {one.left:.3g} left, noise {one.noise:.3g}"
    if one.shares is None:
        return [f"{one.name}: {sizes}"]
    shares = [
        f"  {share.cause}: {percent(max(share.share, 0.0))}, by chance up to {percent(share.null_90)}"
        for share in one.shares.causes
    ]
    rest = f"  noise {percent(one.shares.noise)}, unexplained {percent(one.shares.unexplained)}"
    return [f"{one.name}: {sizes}", *shares, rest]


def _closed(one: Shrinkage) -> str:
    if one.shrinkage is None:
        return f"{one.who}: {times(one.gap)}"
    interval = (
        "" if one.interval_90 is None else " (90 %: {:.0f} to {:.0f})".format(*(100 * x for x in one.interval_90))
    )
    return f"{one.who}: {times(one.gap)}, closes {percent(one.shrinkage)}{interval}"
