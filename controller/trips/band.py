"""The exciter's known gain, and the stroke that it allows.

The known gain is that of the configuration, or the mean over the first tenth of a second of even vibration at a frequency. It
does not follow what is learnt later: an accelerometer that loses its gain looks like an exciter that does, and the loop would
raise the stroke for ever. So the stroke is never more than the wanted v_a asks for at the known gain, times the band.
"""

from bridge.kernel import Record, kernel

KNOWN_S = (
    0.1  # of even vibration that the known gain is a mean of; shorter: the noise of one fit; longer: later bounded
)


@kernel
def begin_known(p: Record, s: Record) -> None:
    """Know what the configuration tells, and nothing else."""
    for i in range(p.candidates):
        s.known_gain[i] = p.told_gain
        s.known_steps[i] = p.known_steps if p.told_gain > 0.0 else 0


@kernel
def note_known(p: Record, s: Record, i: int, gain: float) -> None:
    """Learn the known gain of a candidate frequency, from the first even vibration alone."""
    if s.known_steps[i] < p.known_steps:
        s.known_steps[i] += 1
        s.known_gain[i] += (gain - s.known_gain[i]) / s.known_steps[i]


@kernel
def is_known(p: Record, s: Record, i: int) -> bool:
    """Whether the gain of a candidate is known well enough to judge by it."""
    return s.known_steps[i] >= p.known_steps


@kernel
def banded(p: Record, s: Record, wanted_m: float, model_m: float) -> float:
    """The amplitude that the band allows [m]; sets whether it holds the amplitude back.

    Args:
        p, s: records of `controller.records`.
        wanted_m: by the learnt gain.
        model_m: of a rigid mount, for the same v_a.

    """
    i = s.candidate
    s.banded = 0
    if s.known_steps[i] == 0:
        return wanted_m
    most_m = p.gain_band * model_m / s.known_gain[i]
    if wanted_m <= most_m:
        return wanted_m
    s.banded = 1
    return most_m
