"""The latent friction's part of an answer: shares, sizes, and what these runs cannot tell apart."""

from collections.abc import Sequence

from bridge.log.finding import Finding
from bridge.units import quantity
from diagnosis.latent.answer import LatentSignal
from diagnosis.latent.components import NOISE, SCATTER
from diagnosis.latent.rows import BREAKAWAY, SLIDING
from diagnosis.report.relation_words import share_in_words
from diagnosis.result import Diagnosis, RelationRow, Remainder, Share
from diagnosis.verdict.by_latent import MOST
from plant.effects.library import EFFECTS

_TOLD = 0.02  # share from which a process is told
_UNTIL_TOLD = 3  # processes in a sentence


def latent_shares(latent: Sequence[LatentSignal]) -> tuple[Share, ...]:
    """The shares of every signal as the contract has them."""
    return tuple(
        Share(one.signal, share.what, share.share, None if share.what == NOISE else share.interval_90, share.null_90)
        for one in latent
        for share in one.shares
        if share.share > _TOLD or share.what in (SCATTER, NOISE)
    )


def latent_rows(latent: Sequence[LatentSignal]) -> tuple[RelationRow, ...]:
    """What differs in every signal, beside its noise."""
    return tuple(
        RelationRow(one.signal, "N", one.described, one.differs, one.left, one.noise, _causes(one)) for one in latent
    )


def latent_remainder(latent: Sequence[LatentSignal]) -> Remainder | None:
    """What scatters most and goes with nothing."""
    if not latent:
        return None
    worst = max(latent, key=lambda one: one.left)
    share = sum(share.share for share in worst.shares if share.what == SCATTER)
    return Remainder(share, worst.signal, "", worst.left, worst.noise, "N")


def latent_findings(latent: Sequence[LatentSignal]) -> tuple[Finding, ...]:
    """Signals in which what goes with place may go with time as well."""
    text = "no place is passed twice at another time, so what goes with place may go with time"
    return tuple(Finding("one-pass", one.signal, text) for one in latent if not one.revisited)


def latent_line(latent: Sequence[LatentSignal]) -> str:
    """The largest share that is surely more than chance, for a person who waits; empty where there is none."""
    found = [(share.share, one.signal, share) for one in latent for share in one.shares if share.what in _causes(one)]
    if not found:
        return ""
    _, signal, share = max(found, key=lambda one: one[0])
    return f"{signal}: {share_in_words(Share(signal, share.what, share.share, share.interval_90, share.null_90))}"


def mostly(diagnosis: Diagnosis) -> Share | None:
    """What most of a signal goes with, surely, where no name of the verdict says so; None where nothing does."""
    sure = [
        share
        for share in diagnosis.shares
        if share.signal in (BREAKAWAY, SLIDING)
        and share.what not in (SCATTER, NOISE, *diagnosis.effects)
        and share.share > MOST
        and share.beyond_chance
    ]
    return max(sure, key=lambda share: share.share, default=None)


def latent_answer(diagnosis: Diagnosis) -> str:
    """The same as a sentence; empty where nothing does."""
    top = mostly(diagnosis)
    if top is None:
        return ""
    why = "is not sure enough to be named" if top.what in EFFECTS else "is none that the library can refit"
    return f"For the most part the {top.signal} goes with {share_in_words(top)}; that {why}."


def latent_sentences(diagnosis: Diagnosis, kept: str) -> list[str]:
    """One sentence a signal: how much differs, and what explains how much of it."""
    sentences: list[str] = []
    for row in diagnosis.relations:
        if row.relation not in (BREAKAWAY, SLIDING):
            continue
        own = [share for share in diagnosis.shares if share.signal == row.relation and share.what != NOISE]
        more = sorted((share for share in own if share.what in row.causes), key=lambda share: -share.share)
        told = "; ".join(share_in_words(one) for one in more[:_UNTIL_TOLD])
        of = f"Of the {quantity(row.refitted, row.unit)} that differ in the {row.relation}{kept}"
        sentences.append(f"{of}: {told}." if told else f"{of}, nothing surely explains more than chance would.")
    return sentences


def _causes(one: LatentSignal) -> tuple[str, ...]:
    return tuple(share.what for share in one.shares if share.beyond_chance)
