"""A verdict of the contest in view of the latent friction, which gives a part of the gap a name where no formula fits."""

from collections.abc import Sequence

from diagnosis.latent.answer import LatentSignal
from diagnosis.latent.causes import DIRECTION, PLACE, TIME
from diagnosis.verdict.held_out import FAR_FOR_NO_GAP, HeldOut
from diagnosis.verdict.judge import Verdict
from diagnosis.verdict.probabilities import swapped

_KNOWN = (PLACE, DIRECTION, TIME)  # causes that are effects of the library
MOST = 0.5  # share below which a cause is reported and not named: the rest would be the answer


def named_by(latent: Sequence[LatentSignal]) -> tuple[str, ...]:
    """Effects that predict more than half of a signal, more than chance does, with a size that is the same in all runs."""
    largest: dict[str, float] = {}
    for signal in latent:
        for share in signal.shares if signal.left < signal.differs else ():
            if share.what in _KNOWN and share.beyond_chance and share.agrees and share.share > MOST:
                largest[share.what] = max(share.share, largest.get(share.what, 0.0))
    return tuple(sorted(largest, key=lambda what: -largest[what]))


def with_latent(verdict: Verdict, latent: Sequence[LatentSignal], held_out: HeldOut | None) -> Verdict:
    """What is not explained becomes "partly" where the friction goes for the most part with something that the library has.

    Not explained is what is "unexplained", and "no gap" in the fitted runs where the held-out runs show one.
    """
    names = named_by(latent)[:1]
    shows_elsewhere = verdict.kind == "no-gap" and held_out is not None and held_out.retuned > FAR_FOR_NO_GAP
    not_explained = verdict.kind == "unexplained" or shows_elsewhere
    if not not_explained or not names or verdict.outside or set(names) & set(verdict.refuted):
        return verdict
    probabilities = swapped(verdict.probabilities, next(iter(verdict.probabilities)), names[0])
    return verdict._replace(kind="partly", named=None, by_relations=names, probabilities=probabilities)
