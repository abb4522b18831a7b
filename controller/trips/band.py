"""The exciter's known gain, and the stroke that it allows.

The known gain of a frequency comes from the rig's loop check at the neighbouring tones, else from the configuration, else from
the mean over the first tenth of a second of even vibration, within the range of the check. The stroke never exceeds the stroke
for the wanted v_a at the known gain, times the band.

An accelerometer that loses gain looks like an exciter that loses gain, and the contact is the second witness: a slide that sticks
while the measured v_a is at v_d shows a weak, warm exciter, and the known gain becomes the measured one, down to a floor. A slide
that continues to slide shows a wrong accelerometer.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams

# Time of even vibration over which the known gain is averaged. Shorter: more noise. Longer: the stroke is bounded later.
KNOWN_S = 0.1

CHECK_BLOCKS = 16  # blocks after a loop check that carry its result, a tone each; 8 tones at most, so each comes twice
OTHER_REPORTED_S = 2.0  # time for which GAIN_OTHER is reported: the check's gain differs from the configured gain


@kernel
def begin_known(p: ControllerParams, s: ControllerMemory) -> None:
    """Start from the configured gain alone; without one, no gain is known."""
    for i in range(p.candidates):
        s.known_gain[i] = p.told_gain
        s.known_steps[i] = p.known_steps if p.told_gain > 0.0 else 0
    s.accepted_gain[:] = 0.0


@kernel
def note_check(p: ControllerParams, s: ControllerMemory, tone_Hz: float, gain: float) -> None:
    """Store a tone of the rig's loop check; the tones next to a candidate bound its known gain.

    Between two tones a mount may resonate, so the gain between them counts as known only if their gains are alike.
    """
    if gain <= 0.0 or s.checked_blocks >= CHECK_BLOCKS:
        return
    s.checked_blocks += 1
    rolled_off = tone_Hz / p.accel_bandwidth_Hz
    gain *= math.sqrt(1.0 + rolled_off * rolled_off)
    for i in range(p.candidates):
        frequency_Hz = p.candidate_Hz[i]
        if s.tone_Hz[i, 0] <= tone_Hz <= frequency_Hz:
            s.tone_Hz[i, 0], s.tone_gain[i, 0] = tone_Hz, gain
        if tone_Hz >= frequency_Hz and (s.tone_Hz[i, 1] == 0.0 or tone_Hz <= s.tone_Hz[i, 1]):
            s.tone_Hz[i, 1], s.tone_gain[i, 1] = tone_Hz, gain
    if s.checked_blocks == CHECK_BLOCKS:
        _use_check(p, s)


@kernel
def _use_check(p: ControllerParams, s: ControllerMemory) -> None:
    other = p.told_gain > 0.0
    for i in range(p.candidates):
        low, high = _checked(p, s, i)
        alike = high < p.gain_band * low
        s.known_gain[i] = math.sqrt(low * high)
        s.known_steps[i] = p.known_steps if alike else 0
        s.accepted_gain[i] = 0.0
        other = other and not low / p.gain_band < p.told_gain < high * p.gain_band
    s.gain_other_s = OTHER_REPORTED_S if other else 0.0


@kernel
def _checked(p: ControllerParams, s: ControllerMemory, i: int) -> tuple[float, float]:
    """The lowest and the highest gain that the check allows at a candidate: the gains at the tones next to it.

    Beyond the last tone the gain may change by as much as between the last two tones.
    """
    way = 1 if s.tone_gain[i, 1] == 0.0 else -1
    j = i
    while s.tone_gain[j, 0] == 0.0 or s.tone_gain[j, 1] == 0.0:
        j -= way
        if j < 0 or j >= p.candidates:  # the check had a single tone
            only = max(s.tone_gain[i, 0], s.tone_gain[i, 1])
            return only, only
    low, high = min(s.tone_gain[j, 0], s.tone_gain[j, 1]), max(s.tone_gain[j, 0], s.tone_gain[j, 1])
    beyond = high / low if j != i else 1.0
    return low / beyond, high * beyond


@kernel
def forget_check(s: ControllerMemory) -> None:
    """Drop the result of the last loop check, as another begins."""
    s.checked_blocks, s.gain_other_s = 0, 0.0
    s.tone_Hz[:, :], s.tone_gain[:, :] = 0.0, 0.0


@kernel
def note_known(p: ControllerParams, s: ControllerMemory, i: int, gain: float) -> None:
    """Learn the known gain of a candidate frequency, only from its first even vibration."""
    if s.known_steps[i] < p.known_steps:
        s.known_steps[i] += 1
        s.known_gain[i] += (gain - s.known_gain[i]) / s.known_steps[i]
        if s.checked_blocks >= CHECK_BLOCKS:
            low, high = _checked(p, s, i)
            s.known_gain[i] = min(max(s.known_gain[i], low), high)


@kernel
def is_known(p: ControllerParams, s: ControllerMemory, i: int) -> bool:
    """Whether the gain of a candidate is known well enough to detect faults by it."""
    return s.known_steps[i] >= p.known_steps


@kernel
def accept_weaker(p: ControllerParams, s: ControllerMemory) -> None:
    """Lower the known gain of the present candidate to the measured gain, not below the floor."""
    i = s.candidate
    if s.accepted_gain[i] == 0.0:
        s.accepted_gain[i] = s.known_gain[i]
    s.known_gain[i] = min(max(math.exp(s.log_gain[i]), p.gain_floor * s.accepted_gain[i]), s.known_gain[i])


@kernel
def banded(p: ControllerParams, s: ControllerMemory, wanted_m: float, model_m: float) -> float:
    """The amplitude that the band allows [m]; sets `banded` if the band limits it.

    Args:
        p, s: records of `controller.records`.
        wanted_m: amplitude by the learnt gain.
        model_m: amplitude on a rigid mount, for the same v_a.

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
