"""Groups of rigs that share a gap, by the benefit of closing it."""

from collections import defaultdict
from typing import Literal, NamedTuple

from bridge.units import name_and_unit
from diagnosis.report import words
from diagnosis.report.words import mostly, remainder_in_words, share_in_words
from diagnosis.result import Diagnosis

FORMAT = "fleet/1"
Kind = Literal["named", "unexplained", "no-gap", "not-finished"]


class GroupedRig(NamedTuple):
    """One rig in a group."""

    evidence: str
    report: str  # file next to the index; empty if not written
    verdict: str
    answer: str
    explains: float | None  # share of the gap explained by the cause of the group, 0 to 1; None: unknown
    interval_90: tuple[float, float] | None
    size: str  # size of this cause, in words
    after: str  # next measurement


class RigGroup(NamedTuple):
    """Rigs that share a gap."""

    kind: Kind
    what: str  # effects, wrong numbers, or the quantity that explains most of a signal; empty if unknown
    meaning: str
    helps: float  # sum of the explained shares: number of gaps that a repair of the cause would close
    rigs: tuple[GroupedRig, ...]  # the largest share first


class Failed(NamedTuple):
    """A folder without a diagnosis."""

    evidence: str
    fault: str
    line: str


class Fleet(NamedTuple):
    """All rigs; `groups` by benefit, largest first, rigs without a gap last."""

    format: str
    folders: int
    groups: tuple[RigGroup, ...]
    failed: tuple[Failed, ...]
    left: tuple[str, ...]  # pending folders


def fleet_of(done: list[tuple[str, Diagnosis, str]], failed: list[Failed], left: list[str]) -> Fleet:
    """The fleet from the results so far; `done`: name of the evidence, its diagnosis and the file of its report."""
    members: dict[tuple[Kind, str], list[GroupedRig]] = defaultdict(list)
    for diagnosed in done:
        key, rig = _placed(*diagnosed)
        members[key].append(rig)
    groups = [
        RigGroup(
            kind,
            what,
            "; ".join(words.EFFECT_WORDS.get(name, "") for name in what.split(" + ")) if kind == "named" else "",
            sum(rig.explains or 0.0 for rig in rigs),
            tuple(sorted(rigs, key=lambda rig: -(rig.explains or 0.0))),
        )
        for (kind, what), rigs in members.items()
    ]
    groups.sort(key=lambda group: (group.kind == "no-gap", -group.helps, -len(group.rigs), group.what))
    return Fleet(FORMAT, len(done) + len(failed) + len(left), tuple(groups), tuple(failed), tuple(left))


def _placed(evidence: str, diagnosis: Diagnosis, report: str) -> tuple[tuple[Kind, str], GroupedRig]:
    """Group of a rig, and its row in the group."""
    gap = diagnosis.gap
    kind: Kind = "named"
    what, size, explains, interval_90 = "", "", gap.shrinkage, gap.interval_90
    if diagnosis.verdict in ("effect", "partly"):
        what = " + ".join(sorted(diagnosis.effects))
        size = "; ".join(
            words.estimate_in_words(candidate.effect, *item)
            for candidate in diagnosis.candidates
            if candidate.effect in diagnosis.effects
            for item in candidate.parameters.items()
        )
        shares = [share for share in diagnosis.shares if share.what in diagnosis.effects]
        if explains is None and shares:  # no fit was made: take the share in one signal, from the relations
            most = max(shares, key=lambda share: share.share)
            explains, interval_90, size = most.share, most.interval_90, f"{most.signal}: {share_in_words(most)}"
    elif diagnosis.verdict == "described":
        closing = [number for number in diagnosis.numbers if number.share is not None]
        what = " + ".join(sorted(diagnosis.effects) or (name_and_unit(number.name)[0] for number in diagnosis.numbers))
        size = "; ".join(map(words.closing_number_in_words, diagnosis.numbers))
        explains, interval_90 = max((number.share or 0.0 for number in closing), default=None), None
    elif diagnosis.verdict in ("no-gap", "not-finished"):
        kind, explains, interval_90 = diagnosis.verdict, None, None
    elif (most := mostly(diagnosis)) is not None:
        kind, what, size = "unexplained", f"{most.what} in the {most.signal}", share_in_words(most)
        explains, interval_90 = most.share, most.interval_90
    else:
        kind, explains, interval_90 = "unexplained", None, None
        if diagnosis.remainder is not None:
            what, size = f"something in the {diagnosis.remainder.where}", remainder_in_words(diagnosis.remainder)
    # a fit below the noise floor closes the whole gap and not more; a fit that widens the gap counts as 0
    explains = None if explains is None else min(max(explains, 0.0), 1.0)
    answer, after = words.answer(diagnosis), diagnosis.next_experiment.what
    return (kind, what), GroupedRig(evidence, report, diagnosis.verdict, answer, explains, interval_90, size, after)
