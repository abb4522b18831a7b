"""Which cases a campaign has: decided by its seed alone, so that it can be stopped, taken up again and made longer."""

from typing import Any, NamedTuple
from zlib import crc32

import numpy as np

from diagnosis.making import Case
from diagnosis.protocols import FORCE_PROTOCOL, PROTOCOLS
from tests.campaign.sizes import EFFECT_SIZES, Drawn, draw, possible

KINDS = ("none", "single", "pair")
# the smaller of two effects is to be found, too: no pair has one that is barely visible alone
LEAST_SHARE_IN_A_PAIR = 0.4


class Planned(NamedTuple):
    """One case."""

    folder: str  # a random name: it tells nothing
    kind: str
    protocol: str
    seed: int  # of the rig
    effects: tuple[Drawn, ...]

    def case(self) -> Case:
        return Case(self.protocol, {effect.name: effect.numbers for effect in self.effects})

    def to_json(self) -> dict[str, Any]:
        effects = [effect._asdict() for effect in self.effects]
        return {"kind": self.kind, "protocol": self.protocol, "seed": self.seed, "effects": effects}


def plan(protocol: str, effects: list[str], cases: int, none: int, pairs: int, seed: int) -> list[Planned]:
    """All cases, mixed so that a campaign that is stopped early has some of each.

    Args:
        effects: whose single cases are wanted; none named: all that the protocol can show.
        cases, none, pairs: how many of each effect, without any effect, with two.

    """
    force_driven = protocol == FORCE_PROTOCOL
    vibrated = not force_driven and any(run.vibration for run in PROTOCOLS[protocol])
    names = possible("force" if force_driven else "spring", vibrated)
    unknown = set(effects) - set(names)
    if unknown:
        raise SystemExit(
            f"--effects {', '.join(sorted(unknown))}: not there in protocol {protocol}; {', '.join(names)}"
        )
    wanted = effects or names
    # a folder belongs to one case for ever, whatever else a campaign is told
    planned: list[tuple[float, Planned]] = []

    def add(kind: str, of_kind: int, number: int, count: int, chosen: list[str] | None = None) -> None:
        random = np.random.default_rng([seed, crc32(protocol.encode()), KINDS.index(kind), of_kind, number])
        folder, rig_seed = random.bytes(5).hex(), int(random.integers(1 << 31))
        if kind == "pair":
            chosen = [str(name) for name in random.choice(wanted, 2, replace=False)]
        least = LEAST_SHARE_IN_A_PAIR if kind == "pair" else 0.0
        drawn = tuple(draw(random, name, vibrated, least) for name in chosen or [])
        planned.append(((number + 0.5) / count, Planned(folder, kind, protocol, rig_seed, drawn)))

    for name in wanted:
        for number in range(cases):
            add("single", list(EFFECT_SIZES).index(name), number, cases, [name])
    for number in range(none):
        add("none", 0, number, none)
    for number in range(pairs if len(wanted) > 1 else 0):
        add("pair", crc32(",".join(wanted).encode()), number, pairs)
    return [case for _, case in sorted(planned, key=lambda item: item[0])]
