"""A verdict of the contest in view of the latent friction, which gives a part of the gap a name where no formula fits."""

from collections.abc import Sequence

from diagnosis.latent.answer import LatentSignal
from diagnosis.latent.components import DIRECTION, PLACE, TIME
from diagnosis.verdict.held_out import FAR_FOR_NO_GAP, HeldOut
from diagnosis.verdict.judge import Verdict
from diagnosis.verdict.probabilities import swapped

_KNOWN = (PLACE, DIRECTION, TIME)  # processes that are effects of the library
# Log likelihood that the rows must lose without a process that is named: by chance 0.3 % of records lose 4, and eight processes
# are tried.
_SURE = 4.0
MOST = 0.5  # share below which it is told and not named: the rest would be the answer


def named_by(latent: Sequence[LatentSignal]) -> tuple[str, ...]:
    """Effects whose share of a signal is more than half, more than chance shows, and sure; the largest share first."""
    largest: dict[str, float] = {}
    for signal in latent:
        for share in signal.shares if signal.judged_on_held_out else ():
            if share.what in _KNOWN and share.beyond_chance and share.gain > _SURE and share.share > MOST:
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
