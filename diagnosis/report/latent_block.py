"""Latent friction in an answer: shares, sizes, and causes that these runs cannot separate."""

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

_LEAST_SHARE = 0.02  # smallest share of a cause that is reported
_MOST_IN_SENTENCE = 3  # most causes in a sentence


def latent_shares(latent: Sequence[LatentSignal]) -> tuple[Share, ...]:
    """The shares of every signal, in the format of the diagnosis."""
    return tuple(
        Share(signal.signal, share.what, share.share, None if share.what == NOISE else share.interval_90, share.null_90)
        for signal in latent
        for share in signal.shares
        if share.share > _LEAST_SHARE or share.what in (SCATTER, NOISE)
    )


def latent_rows(latent: Sequence[LatentSignal]) -> tuple[RelationRow, ...]:
    """Sizes of the difference and the noise in every signal."""
    return tuple(
        RelationRow(signal.signal, "N", signal.described, signal.differs, signal.left, signal.noise, _causes(signal))
        for signal in latent
    )


def latent_remainder(latent: Sequence[LatentSignal]) -> Remainder | None:
    """The largest scatter that depends on no variable."""
    if not latent:
        return None
    worst = max(latent, key=lambda signal: signal.left)
    share = sum(share.share for share in worst.shares if share.what == SCATTER)
    return Remainder(share, worst.signal, "", worst.left, worst.noise, "N")


def latent_findings(latent: Sequence[LatentSignal]) -> tuple[Finding, ...]:
    """A finding for each signal in which a dependence on position cannot be separated from a dependence on time."""
    text = "no position is passed twice, so a dependence on position cannot be separated from a dependence on time"
    return tuple(Finding("one-pass", signal.signal, text) for signal in latent if not signal.revisited)


def latent_line(latent: Sequence[LatentSignal]) -> str:
    """The largest share whose interval exceeds chance, as a progress message; empty without such a share."""
    candidates = [
        (share.share, latent_signal.signal, share)
        for latent_signal in latent
        for share in latent_signal.shares
        if share.what in _causes(latent_signal)
    ]
    if not candidates:
        return ""
    _, signal, share = max(candidates, key=lambda candidate: candidate[0])
    return f"{signal}: {share_in_words(Share(signal, share.what, share.share, share.interval_90, share.null_90))}"


def mostly(diagnosis: Diagnosis) -> Share | None:
    """A cause outside the verdict that explains most of a signal, with an interval above chance; None without such a cause."""
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
    """The share of `mostly` as a sentence; empty where it is None."""
    top = mostly(diagnosis)
    if top is None:
        return ""
    why = "it is not certain enough to be named" if top.what in EFFECTS else "the library has no effect for it"
    return f"Largest cause in the {top.signal}: {share_in_words(top)}; {why}."


def latent_sentences(diagnosis: Diagnosis, kept: str) -> list[str]:
    """One sentence per signal: the size of the difference, and the share that each cause explains."""
    sentences: list[str] = []
    for row in diagnosis.relations:
        if row.relation not in (BREAKAWAY, SLIDING):
            continue
        shares = [share for share in diagnosis.shares if share.signal == row.relation and share.what in row.causes]
        largest = sorted((share for share in shares if share.what != NOISE), key=lambda share: -share.share)
        listed = "; ".join(share_in_words(share) for share in largest[:_MOST_IN_SENTENCE])
        off = f"The {row.relation}{kept} is off by {quantity(row.refitted, row.unit)} rms"
        sentences.append(f"{off}: {listed}." if listed else f"{off}; no cause explains it better than chance.")
    return sentences


def _causes(signal: LatentSignal) -> tuple[str, ...]:
    return tuple(share.what for share in signal.shares if share.beyond_chance)
