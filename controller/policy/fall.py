"""Falls of the raw force: a slip relaxes the drive's spring, and the force falls from its crest. No model of the axis is used.

With and without vibration the falls of the force, over the force, are two numbers that answer whether the vibration is needed and
whether it helps. Without a force sensor the elongation of the spring takes the place of the force.
"""

import math

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory, ControllerParams
from bridge.wire.stickslip_pb2 import EXCITE
from controller.estimate.windows import FEWEST, FORCE
from controller.policy.need import way_of

# Time in which the crest of the force is remembered. Shorter: a slide that slips for half of it, with a natural period of 0.5 s,
# shows half of its fall. Longer: friction that changes along the track looks like a fall.
WINDOW_S = 0.5
# Least fall in a slip, over the force; friction that falls by 8 % gives twice that. Smaller: the swing at the end of a fade, of
# 7 % at 100 kg on 5 N/um and 11 % at 1 kg on 11 N/um. Larger: stick-slip of friction that falls by less is not seen.
_LEAST = 0.15
_TIMES = 1.5  # least fall without vibration, over the largest fall with vibration: a track's waves are in both
_NOISES = 8.0  # least fall, in sigmas of a bin: two extremes of 5000 bins are 7 sigma apart
_OF_BIN = math.sqrt(5.0)  # sigma of a bin over (sigma of the slope of four bins, times the bin)
_FORGETS = 0.98  # factor of the largest fall with vibration at each window: half of it after 17 s


@kernel
def note_fall(p: ControllerParams, s: ControllerMemory, force_N: float) -> None:
    """Update crest and fall with the mean force of a bin [N]."""
    along_N = s.direction * force_N
    if s.moved_s < WINDOW_S:  # at the start of a move the slide swings about its mean
        restart_falls(s, force_N)
    s.fall_s += p.bin_s
    if s.fall_s > WINDOW_S:
        if s.mode == EXCITE and s.mode_s > 2.0 * WINDOW_S and s.steady_s > 2.0 * WINDOW_S and s.crest_N > 0.0:
            way = way_of(s)
            s.fall_with_N[way] = max(_FORGETS * s.fall_with_N[way], s.fall_N)
            s.crest_with_N[way] = s.crest_N
        s.fall_s, s.fall_N, s.crest_before_N, s.crest_N = 0.0, 0.0, s.crest_N, along_N
    s.crest_N = max(s.crest_N, along_N)
    s.fall_N = max(s.fall_N, max(s.crest_N, s.crest_before_N) - along_N)


@kernel
def restart_falls(s: ControllerMemory, force_N: float) -> None:
    """Forget crest and falls up to now."""
    s.fall_s, s.fall_N = 0.0, 0.0
    s.crest_N = s.crest_before_N = s.direction * force_N


@kernel
def has_fallen(p: ControllerParams, s: ControllerMemory) -> bool:
    """Whether the force fell by more than noise, waves of the track and the vibrated slide explain."""
    if s.differences[0] < FEWEST:
        return False
    crest_N = max(s.crest_N, s.crest_before_N)
    noise_N = _OF_BIN * p.bin_s * s.sigma[FORCE, 0] + s.resolution[FORCE]
    way, share = way_of(s), _LEAST
    if s.crest_with_N[way] > 0.0:
        share = max(share, _TIMES * s.fall_with_N[way] / s.crest_with_N[way])
    return crest_N > 0.0 and s.fall_N > max(share * crest_N, _NOISES * noise_N)
