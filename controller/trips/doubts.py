"""Which signals are doubted, and the response.

Accelerometer doubted: the vibration continues open loop, at the known gain. Force or slide position doubted: vibration
whenever the drive moves, as when blind. Drive position doubted: the vibration fades to zero, as v_d is unknown.
A trip lasts until the operator resets it or runs a new loop check of the rig (`controller.trips.reset`).
"""

from bridge.kernel import kernel
from bridge.layouts import ControllerMemory

ACCELEROMETER, CONTACT, DRIVE = 1, 2, 4  # bits of `s.doubted`
SOME = 4  # steps between two slow checks


@kernel
def trip(s: ControllerMemory, reason: int, doubts: int) -> None:
    """Doubt signals; the first trip is reported until it ends, unless a later trip ends the vibration."""
    if s.trip == 0 or (doubts == DRIVE and s.doubted & DRIVE == 0):
        s.trip = reason
    s.doubted |= doubts
