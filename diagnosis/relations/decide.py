"""Decision of the relations: causes that they name, effects that no fit needs to try, patterns outside the library."""

import math
from typing import NamedTuple

from diagnosis.evidence.manifest import RigTable
from diagnosis.relations.answer import Answered, Relations
from diagnosis.relations.relation import OUTSIDE

# Log evidence from which a relation names a cause or shows a pattern, and within which another cause is tried by a fit as well.
# With 8 none of 138 cases with known answers shows a pattern more; a cause with less is named by the judge, from all rows.
_SURE = 25.0
# Size of a pattern, in noise and in the size of the part of the chosen causes, from which it counts: a formula that is not quite
# the rig's leaves up to 0.11. Smaller: such formulas are outside. Larger: at 0.8 a yawing guide is not.
_MUCH = 0.5
_BURSTS = 3.0  # mean over median of the local variance from which the residual comes in bursts: 16.8 with drop-outs, 2.2 without
_BURSTING = ("spring", "motion")  # relations whose rows are short enough for that
_SAME_SIZE = 0.01  # chance below which sizes that differ between runs take a name back
# Share of the static friction that an uneven drive must pull with: breakaways on the smoothest surfaces scatter twenty times as
# much, so a smaller one closes nothing of the gap, however well a displacement sensor shows it.
_MATTERS = 1e-4
_LEVELS = frozenset({"drive-stiffness"})  # numbers that the refitted rig follows, so that they close nothing further
# Share of a large effect's size to which a relation must know the size of an effect that no fit tries. Larger: an effect that the
# relation barely shows is lost. Smaller: time.
_KNOWN_SIZE = 0.1
# Relations whose patterns do not count: any function of the drive's place is an uneven drive, and a base that shows slips in
# another way than by a mode is an ordinary mount.
_COARSE = frozenset({"drive", "base"})
# Effects that act in one relation alone, and where it is finer than any fit. The vibration of an exciter is known at a few
# frequencies only, and a base without a mode shows slips: their effects stay with the fits.
SHOWN_BY = {
    "drive-damping": "spring",
    "force-sensor-delay": "spring",
    "force-sensor-lag": "spring",
    "drive-hardening": "spring",
    "force-sensor-drift": "spring",
    "drive-backlash": "spring",
    "drive-speed-ripple": "drive",
}


class Decided(NamedTuple):
    """A cause that a relation names."""

    cause: str
    relation: str
    evidence: float  # natural logarithm by which the relation is worse without it


class Outside(NamedTuple):
    """A pattern of a relation that nothing in the library explains."""

    relation: str
    what: str
    size: float  # rms, in the unit of the relation
    noise: float
    unit: str
    evidence: float


class Decision(NamedTuple):
    """Findings of all relations together; the largest evidence first."""

    decided: tuple[Decided, ...]
    outside: tuple[Outside, ...]


def decision_of(relations: Relations, rig: RigTable) -> Decision:
    """The names and the unexplained patterns of all relations; `rig` gives the size that is too small to matter."""
    pull_N_per_m = rig.drive_stiffness_N_per_m or 0.0
    decided: list[Decided] = []
    outside: list[Outside] = []
    # a base with its own mode changes the vibration of an exciter, also where the mode's formula does not fit every run
    swings = any(answered.name == "base" and answered.chosen.evidence > _SURE for answered in relations.answered)
    for answered in relations.answered:
        idle = answered.name == "drive" and pull_N_per_m * answered.refitted < _MATTERS * rig.static_force_N
        if idle or (swings and answered.name == "exciter"):
            continue
        causes = [cause for cause in _sure(answered) if cause.evidence > _SURE]
        decided += [cause for cause in causes if cause.cause not in OUTSIDE]
        unknown = [_outside_cause(answered, cause) for cause in causes if cause.cause in OUTSIDE]
        outside += unknown or _patterns(answered)
    return Decision(
        tuple(sorted(decided, key=lambda cause: -cause.evidence)),
        tuple(sorted(outside, key=lambda left: -left.evidence)),
    )


def ruled_out(relations: Relations, decision: Decision) -> frozenset[str]:
    """Effects that a relation would show, and that these runs do not have: no fit needs to try them.

    Where a relation names causes, those that explain it worse; elsewhere those whose size it knows to a tenth of a large
    effect's, with less evidence than no effect at all.
    """
    effects: set[str] = set()
    naming = {cause.relation for cause in decision.decided}
    for answered in relations.answered:
        names = answered.name in naming
        least = answered.chosen.evidence - _SURE if names else 0.0
        for alone in answered.ranking.singles:
            (term,), (deviation,) = alone.terms, alone.deviations
            known = names or float(deviation.max()) < _KNOWN_SIZE * term.spread
            if SHOWN_BY.get(term.cause) == answered.name and alone.evidence < least and known:
                effects.add(term.cause)
        effects -= {*answered.chosen.causes}
    return frozenset(effects)


def _sure(answered: Answered) -> list[Decided]:
    """The chosen causes with one size in all runs that predict the held-out runs where these would show them."""
    shares = {} if answered.shares is None else {(share.cause, share.form): share for share in answered.shares.causes}
    result: list[Decided] = []
    for term, lost, chance in zip(answered.chosen.terms, answered.lost, answered.agreement, strict=True):
        share = shares.get((term.cause, term.form))
        shows = share is not None and share.expected > share.null_90 >= share.share and term.cause not in _LEVELS
        if chance > _SAME_SIZE and not shows:
            result.append(Decided(term.cause, answered.name, lost))
    return result


def _outside_cause(answered: Answered, cause: Decided) -> Outside:
    term = next(term for term in answered.chosen.terms if term.cause == cause.cause)
    return Outside(
        answered.name, f"{term.cause}: {term.form}", _taken(answered), answered.noise, answered.unit, cause.evidence
    )


def _taken(answered: Answered) -> float:
    """Size of the part that the chosen causes explain."""
    return math.sqrt(max(answered.refitted**2 - answered.left**2, 0.0))


def _patterns(answered: Answered) -> list[Outside]:
    """The pattern with the most evidence, or bursts; empty without."""
    taken = _taken(answered) if answered.chosen.terms else 0.0
    for seen in () if answered.name in _COARSE else answered.patterns:
        if seen.evidence > _SURE and seen.rms > _MUCH * max(answered.noise, taken):
            what = f"over {seen.what}"
            return [Outside(answered.name, what, seen.rms, answered.noise, answered.unit, seen.evidence)]
    quiet = answered.noise / math.sqrt(answered.bursts)
    size = math.sqrt(max(answered.left**2 - quiet**2, 0.0))
    if answered.name in _BURSTING and answered.bursts > _BURSTS and size > _MUCH * max(quiet, taken):
        return [Outside(answered.name, "in bursts", size, quiet, answered.unit, answered.bursts)]
    return []
