"""The figures of one diagnosis, a few lines of text, which docs/quality/results.md quotes."""

from bridge.units import percent, times
from diagnosis.evidence.folder import Evidence
from diagnosis.gap.prepare import prepare
from diagnosis.latent.answer import latent_of
from diagnosis.relations.answer import Answered, relations_of
from diagnosis.relations.decide import decision_of
from diagnosis.report.latent_block import latent_shares
from diagnosis.report.relation_words import share_in_words
from diagnosis.report.words import estimate_in_words, headline
from diagnosis.result import Diagnosis, Shrinkage

_SHOWN = 4  # candidates


def lines(found: Diagnosis) -> list[str]:
    """Verdict, candidates with their parameters, gap on the held-out runs, where it lies, seconds."""
    gap = found.gap
    said = [f"verdict     {headline(found)}"]
    for one in found.candidates[:_SHOWN]:
        sizes = "; ".join(estimate_in_words(one.effect, *item) for item in one.parameters.items())
        said.append(f"candidate   {one.effect} {percent(one.probability)}{': ' if sizes else ''}{sizes}")
    said += [f"alike       {', '.join(group)}" for group in found.not_distinguishable]
    said.append(
        f"held out    {times(gap.nominal)} as described, {times(gap.retuned)} retuned, {times(gap.with_effect)} as judged"
    )
    said += [f"  {_closed(one)}" for one in gap.compared]
    said += [
        f"where       {percent(cell.share)} {cell.signal} {cell.regime} {cell.band_Hz[0]:g}-{cell.band_Hz[1]:g} Hz {cell.run}"
        for cell in found.where[:3]
    ]
    said += [
        f"moved       {one.name} {one.described:.4g} -> {one.retuned:.4g}"
        for one in found.rig
        if abs(one.retuned - one.described) > 2.0 * one.tolerance * (one.described or 1.0)
    ]
    return [*said, f"next        {found.next_experiment.what}", f"took        {found.elapsed_s:.0f} s"]


def of_relations(evidence: Evidence) -> list[str]:
    """The relations between channels: sizes, shares on the held-out runs, omitted relations."""
    runs = prepare(evidence)
    relations = relations_of(evidence.rig, runs)
    said = [line for one in relations.answered for line in _relation(one)]
    decision = decision_of(relations, evidence.rig)
    said += [f"{one.relation}: named: {one.cause}" for one in decision.decided]
    said += [
        f"{one.relation}: outside: {one.what}: {one.size:.3g} {one.unit}, noise {one.noise:.3g}"
        for one in decision.outside
    ]
    return [*said, *(f"{one.name}: left out: {one.why}" for one in relations.missing)]


def of_latent(evidence: Evidence) -> list[str]:
    """Latent friction: the variation on the held-out runs, and its shares."""
    said: list[str] = []
    for one in latent_of(evidence.rig, prepare(evidence)):
        once = "" if one.revisited else "; each place once"
        said.append(f"{one.signal}: {one.differs:.3g} N differ in {one.rows} rows, noise {one.noise:.2g}{once}")
        said += [f"  {share_in_words(share)}" for share in latent_shares([one])]
    return said


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
