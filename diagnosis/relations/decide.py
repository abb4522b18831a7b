"""What the relations decide: causes that they name, and what they show that nothing in the library explains."""

import math
from typing import NamedTuple

from diagnosis.evidence.manifest import RigTable
from diagnosis.relations.answer import Answered, Relations
from diagnosis.relations.relation import OUTSIDE
from diagnosis.relations.shares import RelationShare

# Log evidence by which a set must fall without a cause before the cause is named, beyond the logarithm of the number of
# columns tried. Smaller: noise that is not quite even gets a name. Larger: small effects do not. Counted:
# docs/method/relations.md.
_DECIDES = 8.0
_ADDS = 0.02  # share of the evidence of a set below which a further cause is what the first one's formula does not fit
_SAME_SIZE = 0.01  # chance below which sizes that differ between runs take a name back
# Log evidence of a pattern that nothing explains, and its size against the noise, from which it is told.
_PATTERN, _PATTERN_OVER_NOISE = 25.0, 0.5
_MISMATCH = 0.1  # share of what the named causes take that their formulas may leave as a pattern
_BURSTS = 2.0  # mean over median of the local variance from which what is left comes in bursts
# Relations whose patterns are not told: a base that shows slips in another way than by a mode is an ordinary mount.
_COARSE = frozenset({"base"})
_UNEVEN = "drive-speed-ripple"
# Share of the static friction that an uneven drive must pull with: breakaways on the smoothest surfaces scatter twenty times as
# much, so a smaller one closes nothing of the gap, however well a displacement sensor shows it.
_MATTERS = 1e-4
_BURSTING = ("spring", "motion")  # relations whose rows are short enough for that
_NEAR = 5.0  # log evidence within which another cause would do as well
_LEVELS = frozenset({"drive-stiffness"})
# Share of a large effect's size to which a relation must know the size of an effect that no fit tries. Larger: an effect that the
# relation can hardly see is lost. Smaller: time.
_KNOWN_SIZE = 0.1
# Effects that act in one relation alone, and where it is finer than any fit. What an exciter delivers is known at a few
# frequencies only, and a base shows slips without a mode of its own: their effects stay with the fits.
SHOWN_BY = {
    "drive-damping": "spring",
    "force-sensor-delay": "spring",
    "force-sensor-lag": "spring",
    "drive-hardening": "spring",
    "force-sensor-drift": "spring",
    "drive-backlash": "spring",
    "drive-speed-ripple": "drive",
}
# Causes that one relation alone cannot tell from a cause that it names.
_ALIKE = {
    "drive-stiffness": ("drive-stiffness", "force-sensor-gain", "frame-compliance"),
    "accelerometer-gain": ("accelerometer-gain",),
}


class Decided(NamedTuple):
    """A cause that a relation names."""

    cause: str
    relation: str
    evidence: float  # natural logarithm by which the relation is worse without it
    alike: tuple[str, ...]  # causes that this relation cannot tell from it, itself among them
    share: RelationShare | None  # on the held-out runs

    @property
    def known(self) -> bool:
        """Whether the library has it."""
        return self.cause not in OUTSIDE


class Outside(NamedTuple):
    """What a relation shows and nothing in the library explains."""

    relation: str
    what: str
    size: float  # rms, in the unit of the relation
    noise: float
    unit: str
    evidence: float


class Decision(NamedTuple):
    """What all relations together say; the largest evidence first."""

    decided: tuple[Decided, ...]
    outside: tuple[Outside, ...]


def decision_of(relations: Relations, rig: RigTable) -> Decision:
    """The names and the unexplained patterns of all relations; `rig` says how small is too small to matter."""
    pull_N_per_m = rig.drive_stiffness_N_per_m or 0.0
    decided: list[Decided] = []
    outside: list[Outside] = []
    for answered in relations.answered:
        if answered.name == "drive" and pull_N_per_m * answered.refitted < _MATTERS * rig.static_force_N:
            continue
        decided_here = _decided(answered)
        pattern = _pattern(answered, decided_here)
        if pattern is not None and answered.name == "drive":  # any function of the place is an uneven drive
            decided_here, pattern = [Decided(_UNEVEN, answered.name, pattern.evidence, (_UNEVEN,), None)], None
        decided += decided_here
        outside += [_outside_cause(answered, cause) for cause in decided_here if not cause.known]
        if pattern is not None and not any(not cause.known for cause in decided_here):
            outside.append(pattern)
    # a base with a mode of its own changes what an exciter delivers, also where the mode's formula does not fit every run
    if any(answered.name == "base" and answered.chosen.evidence > _limit(answered) for answered in relations.answered):
        decided = [cause for cause in decided if cause.relation != "exciter"]
        outside = [left for left in outside if left.relation != "exciter"]
    return Decision(
        tuple(sorted(decided, key=lambda cause: -cause.evidence)),
        tuple(sorted(outside, key=lambda left: -left.evidence)),
    )


def ruled_out(relations: Relations, decision: Decision) -> frozenset[str]:
    """Effects that a relation would show, and that these runs do not have: no fit needs to try them.

    Where a relation names causes, its other effects; elsewhere those whose size its best column knows to a tenth of a large
    effect's, with less evidence than no effect at all.
    """
    effects: set[str] = set()
    for answered in relations.answered:
        shown = {name for name, relation in SHOWN_BY.items() if relation == answered.name}
        kept = {term.cause for term in answered.chosen.terms}
        named = [cause for cause in decision.decided if cause.relation == answered.name and cause.known]
        if named:
            effects |= shown - kept - {other for cause in named for other in cause.alike}
        for alone in answered.ranking.singles:
            (term,), (deviation,) = alone.terms, alone.deviations
            known = float(deviation.max()) < _KNOWN_SIZE * term.spread
            if term.cause in shown - kept and alone.evidence < 0.0 and known:
                effects.add(term.cause)
    return frozenset(effects)


def _decided(answered: Answered) -> list[Decided]:
    limit = _limit(answered)
    shares = {} if answered.shares is None else {(share.cause, share.form): share for share in answered.shares.causes}
    decided: list[Decided] = []
    for number, term in enumerate(answered.chosen.terms):
        lost, share = answered.lost[number], shares.get((term.cause, term.form))
        # a number beyond its tolerance: the refitted rig follows it, so it closes nothing that the baseline leaves
        tested = share is not None and share.expected > share.null_90 and term.cause not in _LEVELS
        borne_out = share is None or not tested or share.share > share.null_90
        if (
            lost > limit
            and lost > _ADDS * answered.chosen.evidence
            and answered.agreement[number] > _SAME_SIZE
            and borne_out
        ):
            cause = _of_library(answered, term.cause)
            decided.append(Decided(cause, answered.name, lost, _alike(answered, cause), share))
    return decided


def _limit(answered: Answered) -> float:
    return _DECIDES + math.log(max(answered.tried, 1))


def _of_library(answered: Answered, cause: str) -> str:
    """The cause, or the best of the library where that would do as well."""
    if cause not in OUTSIDE or len(answered.chosen.terms) > 1:
        return cause
    known = next((single for single in answered.ranking.singles if single.causes[0] not in OUTSIDE), None)
    return cause if known is None or answered.chosen.evidence - known.evidence >= _NEAR else known.causes[0]


def _alike(answered: Answered, cause: str) -> tuple[str, ...]:
    """Causes whose own best column comes within a few of log evidence of this one's, where it stands alone."""
    known = _ALIKE.get(cause, (cause,))
    if len(answered.chosen.terms) > 1:
        return known
    best = next((single.evidence for single in answered.ranking.singles if single.causes == (cause,)), 0.0)
    near = [
        single.causes[0]
        for single in answered.ranking.singles
        if best - single.evidence < _NEAR and single.causes[0] not in OUTSIDE
    ]
    return tuple(dict.fromkeys((cause, *known, *near)))


def _outside_cause(answered: Answered, cause: Decided) -> Outside:
    term = next(term for term in answered.chosen.terms if term.cause == cause.cause)
    taken = math.sqrt(max(answered.refitted**2 - answered.left**2, 0.0))
    return Outside(answered.name, f"{term.cause}: {term.form}", taken, answered.noise, answered.unit, cause.evidence)


def _pattern(answered: Answered, named: list[Decided]) -> Outside | None:
    taken = math.sqrt(max(answered.refitted**2 - answered.left**2, 0.0)) if named else 0.0
    # a motion of the drive that the held-out runs do not repeat is its command
    predicts = [
        seen for seen in answered.patterns if answered.name != "drive" or seen.share is None or seen.share > 0.0
    ]
    for pattern in () if answered.name in _COARSE else predicts:
        if pattern.evidence > _PATTERN and pattern.rms > max(_PATTERN_OVER_NOISE * answered.noise, _MISMATCH * taken):
            return Outside(
                answered.name, f"over {pattern.what}", pattern.rms, answered.noise, answered.unit, pattern.evidence
            )
    if answered.bursts > _BURSTS and answered.name in _BURSTING:
        quiet = answered.noise / math.sqrt(answered.bursts)
        size = math.sqrt(max(answered.left**2 - quiet**2, 0.0))
        if size > max(_PATTERN_OVER_NOISE * quiet, _MISMATCH * taken):
            return Outside(answered.name, "in bursts", size, quiet, answered.unit, answered.bursts)
    return None
