"""Cases with known answers, from the folder that `python -m tests.blind develop` made."""

import hashlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

from bridge.faults import Fault
from bridge.files import read_json

ANSWERS = "answers"  # folder of the kept answers, next to the sets
_VISIBLE = 2.0  # detection limits
MAKE = "python -m tests.blind develop"


class Case(NamedTuple):
    """One evidence and the truth about it."""

    name: str
    group: str  # set
    kind: Literal["single", "pair", "none", "outside", "number", "measured"]
    effects: frozenset[str]  # effects of the rig; of a measured log the names that count as right
    limits: float | None  # detection limits of the weakest effect; None: not measured, the effect is large
    number: str | None  # key of the description with a wrong value
    sha256: str  # of the evidence
    kept: dict[str, dict[str, float]]  # answers of earlier versions, by method
    folder: Path

    @property
    def half(self) -> str:
        """`a` for development, `b` for decisions; fixed by the name."""
        return "a" if hashlib.sha256(self.name.encode()).digest()[0] % 2 == 0 else "b"

    @property
    def visible(self) -> bool:
        """Whether the effect is worth two detection limits or more."""
        return self.limits is None or self.limits >= _VISIBLE

    @property
    def truth(self) -> str:
        """The right answer in words."""
        names = " + ".join(sorted(self.effects))
        if self.kind == "number":
            return f"{self.number} described wrong"
        return {"none": "none", "outside": f"outside: {names}", "measured": " or ".join(sorted(self.effects))}.get(
            self.kind, names
        )


def read_cases(folder: Path, sets: Sequence[str] = (), half: str | None = None) -> list[Case]:
    """The cases of these sets in this half; all if none is given. Raises Fault BAD_SET without a case."""
    cases: list[Case] = []
    for path in sorted(folder.glob("*/*.json")):
        if path.parent.name == ANSWERS or (sets and path.parent.name not in sets):
            continue
        case = _case(read_json(path), path)
        if half in (None, case.half):
            cases.append(case)
    if not cases:
        wanted = f" of {', '.join(sets)}" if sets else ""
        raise Fault("BAD_SET", f"{folder}: holds no case{wanted}; `{MAKE} {folder}` makes them")
    return cases


def _case(table: dict[str, Any], path: Path) -> Case:
    try:
        return Case(
            table["case"], table["set"], table["kind"], frozenset(table["effects"]), table["limits"], table["number"],
            table["sha256"], table["kept"], path.with_suffix(""),
        )  # fmt: skip
    except KeyError as error:
        raise Fault("BAD_SET", f"{path}: {error} is missing; delete the file, `{MAKE}` makes it again") from None
