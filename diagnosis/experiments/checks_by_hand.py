"""Checks by hand, if no run of the rig separates two explanations: with the eye, a weight or a hammer."""

from typing import Final

from diagnosis.hypotheses.catalogue import CATALOGUE
from diagnosis.hypotheses.catalogue_row import FRAME, SPEEDS, SWEEP, TAP, TRACK, WEIGHT
from plant.effects.library import EFFECTS

UNCOUPLE = "Uncouple the drive from the mass and vibrate: any vibration left in the force signal is not force."
SINE = "Halve the piezo's voltage, then tighten its mount: harmonics of a drive too hard or loose fall faster than the vibration."
_FORCES = "Move the axis to and fro at 0.2, 1 and 5 times the present speeds, from other positions, with rests of 1, 10 and 60 s."
_BY_PLACE: Final = {"sensor": WEIGHT, "drive": TAP, "structure": FRAME, "piezo": SWEEP, "friction": SPEEDS}


def advice(effects: tuple[str, ...], drive: str) -> str:
    """A physical check that separates these effects; with `drive` "force" other motions separate effects of friction."""
    for a in effects:
        for b in effects:
            check = CATALOGUE[a].check_against.get(b) or CATALOGUE[b].check_against.get(a)
            if check is not None and not (drive == "force" and check in {TRACK, SPEEDS}):
                return check
    # checks at a single part come before checks that need runs
    for places in (("sensor",), ("piezo", "structure", "drive"), ("friction",)):
        for name in effects:
            place = EFFECTS[name].acts_on
            if place in places:
                if drive == "force" and place == "friction":
                    return _FORCES
                return CATALOGUE[name].check or _BY_PLACE[place]
    return _FORCES if drive == "force" else SPEEDS
