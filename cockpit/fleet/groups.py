"""Which rigs share a gap, and where mending would help most."""

from collections import defaultdict
from typing import Literal, NamedTuple

from diagnosis.report import words
from diagnosis.report.latent_block import mostly
from diagnosis.report.relation_words import remainder_in_words, share_in_words
from diagnosis.result import Diagnosis

FORMAT = "fleet/1"
Kind = Literal["named", "unexplained", "no-gap"]


class Rig(NamedTuple):
    """One rig in a group."""

    evidence: str
    report: str  # file beside the index; empty where none was written
    verdict: str
    answer: str
    explains: float | None  # share of the gap that what the group shares explains, 0 to 1; None: not known
    interval_90: tuple[float, float] | None
    size: str  # of what the group shares, in words
    after: str  # what to measure next


class Group(NamedTuple):
    """Rigs that share a gap."""

    kind: Kind
    what: str  # effects, or what most of a signal goes with; empty where nothing is known
    meaning: str
    helps: float  # sum of the shares that are explained: the gaps that mending this would close
    rigs: tuple[Rig, ...]  # the largest share first


class Failed(NamedTuple):
    """A folder without a diagnosis."""

    evidence: str
    fault: str
    line: str


class Fleet(NamedTuple):
    """All rigs; `groups` where mending helps most first, rigs without a gap last."""

    format: str
    folders: int
    groups: tuple[Group, ...]
    failed: tuple[Failed, ...]
    left: tuple[str, ...]  # folders that are not done yet


class Diagnosed(NamedTuple):
    """A folder with its diagnosis, and the file of its report."""

    evidence: str
    diagnosis: Diagnosis
    report: str


def fleet_of(done: list[Diagnosed], failed: list[Failed], left: list[str]) -> Fleet:
    """The fleet of what is known so far."""
    members: dict[tuple[Kind, str], list[Rig]] = defaultdict(list)
    for one in done:
        key, rig = _placed(one)
        members[key].append(rig)
    groups = [
        Group(
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


def _placed(one: Diagnosed) -> tuple[tuple[Kind, str], Rig]:
    """The group of a rig, and its row there."""
    told, gap = one.diagnosis, one.diagnosis.gap
    kind: Kind = "named"
    what, size, explains, between = "", "", gap.shrinkage, gap.interval_90
    if told.verdict in ("effect", "partly"):
        what = " + ".join(sorted(told.effects))
        size = "; ".join(
            words.estimate_in_words(candidate.effect, *item)
            for candidate in told.candidates
            if candidate.effect in told.effects
            for item in candidate.parameters.items()
        )
        own = [share for share in told.shares if share.what in told.effects]
        if explains is None and own:  # no fit was made: what the relations say, of one signal
            most = max(own, key=lambda share: share.share)
            explains, between, size = most.share, most.interval_90, f"{most.signal}: {share_in_words(most)}"
    elif told.verdict == "no-gap":
        kind, explains, between = "no-gap", None, None
    elif (most := mostly(told)) is not None:
        kind, what, size = "unexplained", f"{most.what} in the {most.signal}", share_in_words(most)
        explains, between = most.share, most.interval_90
    else:
        kind, explains, between = "unexplained", None, None
        if told.remainder is not None:
            what, size = f"something in the {told.remainder.where}", remainder_in_words(told.remainder)
    # a fit below the noise floor closes the whole gap, not more; one that makes it worse helps nobody
    explains = None if explains is None else min(max(explains, 0.0), 1.0)
    answer, after = words.answer(told), told.next_experiment.what
    return (kind, what), Rig(one.evidence, one.report, told.verdict, answer, explains, between, size, after)
