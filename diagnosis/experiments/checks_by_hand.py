"""What to do by hand where no run of the rig tells two explanations apart: one look, one weight or one tap."""

from typing import Final

from plant.effects.library import EFFECTS

_WEIGHT = "Hang a known weight on the force sensor, and read it empty: its gain and its zero are then known."
_ZERO = "Unload the force sensor and read it for ten minutes: a zero that wanders is seen at once."
_TAP = (
    "Hold the mass still and tap the drive with a small hammer: a late or smoothed force reading shows against the "
    "accelerometer, damping and compliance of the drive as ringing."
)
_FRAME = "Put an accelerometer on what holds the drive, then on the base, and tap: what swings there is seen directly."
_SHAKER = "Put both accelerometers on one calibrated shaker, or turn them over: gravity makes 2 g of difference."
UNCOUPLE = "Uncouple the drive from the mass and vibrate: what the force signal still shows is not force."
SINE = "Halve the piezo's voltage, then tighten its mount: harmonics of a drive too hard or loose fall faster than the vibration."
_SWEEP = "Sweep the piezo from 0.5 to 5 kHz at rest and look at the base accelerometer: it shows what is delivered."
_DRIVE = "Measure the drive position with a second sensor, unloaded: an uneven drive is uneven without the mass, too."
_TRACK = (
    "Drag along the same track twice, the second time at another speed: what belongs to the place comes back there."
)
_SPEEDS = "Drag at 0.2, 1 and 5 times the present speed, and hold the drive for 1, 10 and 60 s in between."
_REVERSE = "Drag to and fro over the same track."
_REPEAT = "Repeat one run unchanged after a pause of ten minutes: what drifts does not come back."
_FORCES = "Move the axis to and fro at 0.2, 1 and 5 times the present speeds, from other positions, with rests of 1, 10 and 60 s."
_PAIRS: Final[dict[frozenset[str], str]] = {
    frozenset(("force-sensor-delay", "drive-damping")): _TAP,
    frozenset(("force-sensor-lag", "drive-damping")): _TAP,
    frozenset(("force-sensor-lag", "force-sensor-delay")): _TAP,
    frozenset(("force-sensor-lag", "frictional-lag")): _TAP,
    frozenset(("frame-compliance", "drive-damping")): _FRAME,
    frozenset(("frame-compliance", "base-compliance")): _FRAME,
    frozenset(("frame-compliance", "drive-stiffness")): _FRAME,
    frozenset(("force-sensor-gain", "coulomb-level")): _WEIGHT,
    frozenset(("force-sensor-gain", "static-level")): _WEIGHT,
    frozenset(("force-sensor-gain", "drive-stiffness")): _WEIGHT,
    frozenset(("force-sensor-bias", "direction-dependent-friction")): _WEIGHT,
    frozenset(("force-sensor-drift", "friction-drift")): _ZERO,
    frozenset(("position-dependent-friction", "normal-load-fluctuation")): _TRACK,
    frozenset(("position-dependent-friction", "drive-speed-ripple")): _DRIVE,
    frozenset(("normal-load-fluctuation", "drive-speed-ripple")): _DRIVE,
    frozenset(("position-dependent-friction", "friction-drift")): _REPEAT,
    frozenset(("static-friction-ageing", "static-level")): _SPEEDS,
}
_SINGLE: Final[dict[str, str]] = {
    "force-sensor-gain": _WEIGHT,
    "force-sensor-bias": _WEIGHT,
    "force-sensor-drift": _ZERO,
    "force-sensor-lag": _TAP,
    "force-sensor-delay": _TAP,
    "accelerometer-gain": _SHAKER,
    "frame-compliance": _FRAME,
    "base-compliance": _FRAME,
    "drive-speed-ripple": _DRIVE,
    "direction-dependent-friction": _REVERSE,
    "friction-drift": _REPEAT,
    "position-dependent-friction": _TRACK,
    "normal-load-fluctuation": _TRACK,
}
_BY_PLACE: Final = {"sensor": _WEIGHT, "drive": _TAP, "structure": _FRAME, "piezo": _SWEEP, "friction": _SPEEDS}


def advice(effects: tuple[str, ...], drive: str) -> str:
    """A physical check that separates these effects; with `drive` "force" friction is told apart by other motions."""
    for a in effects:
        for b in effects:
            if frozenset((a, b)) in _PAIRS and not (
                drive == "force" and _PAIRS[frozenset((a, b))] in {_TRACK, _SPEEDS}
            ):
                return _PAIRS[frozenset((a, b))]
    # what is checked at one part alone comes before what needs runs
    for places in (("sensor",), ("piezo", "structure", "drive"), ("friction",)):
        for name in effects:
            if EFFECTS[name].acts_on in places:
                if drive == "force" and EFFECTS[name].acts_on == "friction":
                    return _FORCES
                return _SINGLE.get(name, _BY_PLACE[EFFECTS[name].acts_on])
    return _FORCES if drive == "force" else _SPEEDS
