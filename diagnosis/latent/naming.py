"""Effects that the latent friction shows where no formula explains the runs."""

from collections.abc import Sequence
from typing import Final

from diagnosis.latent.answer import LatentSignal
from diagnosis.latent.causes import DIRECTION, PLACE, TIME

_KNOWN = (PLACE, DIRECTION, TIME)  # causes that are effects of the library
MOST: Final = 0.5  # share below which a cause is reported and not named: the rest would be the answer


def named_by(latent: Sequence[LatentSignal]) -> tuple[str, ...]:
    """Effects that predict more than half of a signal, more than chance does, with a size that is the same in all runs."""
    largest: dict[str, float] = {}
    for signal in latent:
        for share in signal.shares if signal.left < signal.differs else ():
            if share.what in _KNOWN and share.beyond_chance and share.agrees and share.share > MOST:
                largest[share.what] = max(share.share, largest.get(share.what, 0.0))
    return tuple(sorted(largest, key=lambda what: -largest[what]))
