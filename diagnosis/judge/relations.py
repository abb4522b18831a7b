"""The relations between channels as witnesses: exact evidence of regressions at sensor noise, for and against an effect."""

import math
from collections.abc import Sequence
from typing import Final

from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.problem import PIEZO_EFFECTS
from diagnosis.hypotheses.hypothesis import LEVELS
from diagnosis.relations.answer import Answered
from diagnosis.relations.decide import SHOWN_BY, Outside
from diagnosis.relations.relation import OUTSIDE

# Share of the static friction; breakaways on the smoothest surfaces scatter ten times as much. Smaller: a drive that a sensor
# shows to be uneven, and that moves nothing, gets a name. Larger: weak ripples do not.
_MATTERS = 1e-4
# Log evidence of a free function on top of the chosen causes that halves the evidence of a relation: where a formula differs from
# the rig, a second cause takes the remainder of the first. Smaller: two true causes become one. Larger: such second names.
_DIFFERS = 10.0
# Share of the kept runs in a relation: a cause that takes less is the remainder of the formula of another.
_LEAST = 0.01
_SURE = 25.0  # log evidence at which half of a pattern counts
SAME_SIZE = 0.01  # chance below which the sizes of two runs differ
# Effects that act in one relation alone, at a finer noise than any feature.
_ALONE: Final = SHOWN_BY | dict.fromkeys(PIEZO_EFFECTS, "exciter")
Names = frozenset[str]


def speaking(relations: Sequence[Answered], rig: RigTable) -> list[Answered]:
    """The relations whose leading cause predicts the kept runs, or that have none, and that matter.

    Rows are so many that a formula that differs from the rig gets an evidence of hundreds; it does not predict another run. A
    drive whose unevenness pulls with less than the friction scatters by does not matter.
    """
    pull_N_per_m = rig.drive_stiffness_N_per_m or 0.0
    least_N = _MATTERS * rig.static_force_N
    return [
        each
        for each in relations
        if _lead(each) not in _refuted(each) and (each.name != "drive" or pull_N_per_m * each.refitted > least_N)
    ]


def evidence_of(relations: Sequence[Answered], names: Names) -> float:
    """Log evidence of all relations for these effects against the rig without any."""
    return math.fsum(evidence_in(answered, names) for answered in relations)


def beyond_library(relations: Sequence[Answered], outside: Sequence[Outside]) -> float:
    """Largest share, over the relations, of the content above noise that nothing in the library takes, 0 to 1."""
    by_name = {each.name: each for each in relations}
    shares = [0.0]
    for left in outside:
        answered = by_name[left.relation]
        if left.what.partition(":")[0] not in _refuted(answered):
            gap = max(answered.refitted**2 - answered.noise**2, 1e-30)
            shares.append(min(left.size**2 / gap, 1.0) * left.evidence / (left.evidence + _SURE))
    return max(shares)


def shown(relations: Sequence[Answered]) -> Names:
    """The effects that a relation has chosen."""
    return frozenset(
        cause for answered in relations for cause in set(answered.chosen.causes) - OUTSIDE - _refuted(answered)
    )


def evidence_in(answered: Answered, names: Names) -> float:
    """Log evidence of one relation: its best set of the names that it knows.

    Nothing is a set as well, except for an effect that acts in this relation alone, and which the relation may exclude: where it
    forbids the sign, the effect has as little evidence as any.
    """
    price = math.log(max(answered.tried, 1))
    names = names - _refuted(answered)
    known = [each for each in (*answered.ranking.singles, *answered.ranking.best) if math.isfinite(each.evidence)]
    values = [each.evidence - price * len(each.causes) for each in known if set(each.causes) <= names]
    if not any(_ALONE.get(name) == answered.name for name in names):
        values.append(0.0)
    least = min((each.evidence - price for each in known), default=0.0)
    patterns = max((pattern.evidence for pattern in answered.patterns), default=0.0)
    return max(values, default=min(least, 0.0)) / (1.0 + max(patterns, 0.0) / _DIFFERS)


def _lead(answered: Answered) -> str:
    """The chosen cause without which the relation is worst; empty without any."""
    return max(zip(answered.lost, answered.chosen.causes, strict=True), default=(0.0, ""))[1]


def _refuted(answered: Answered) -> Names:
    """Chosen causes that the kept runs would show and do not, or contradict; without kept runs, of another size in each run.

    A number beyond its tolerance is never refuted so: the refitted rig follows it, and it closes no further part.
    """
    shares = () if answered.shares is None else answered.shares.causes
    idle = {share.cause for share in shares if share.expected > share.null_90 + min(share.share, 0.0)}
    idle -= {share.cause for share in shares if share.share > max(share.null_90, _LEAST)}
    if not shares:
        sizes = zip(answered.chosen.causes, answered.agreement, strict=True)
        idle = {cause for cause, chance in sizes if chance < SAME_SIZE}
    return frozenset(idle - LEVELS.keys())
