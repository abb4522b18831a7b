"""One table `[[fault]]` of a scenario: kind, target, begin and duration of a fault."""

import json
from typing import Annotated

from pydantic import Field, model_validator

from bridge.config import Strict, validate
from bridge.faults import Fault
from bridge.rig.faults.kinds import BUS, KINDS, LARGEST, PROCESS, SENSORS, TARGETS, group_of
from bridge.wire.channels import CHANNELS
from bridge.wire.topics import FAULT

_LONGEST = 10_000  # longest table of an operator's request [bytes]; every valid table has fewer than 500
_Time = Annotated[float, Field(ge=0, le=1e9)]  # 30 years; a far longer time overflows the count of blocks


class FaultTable(Strict):
    """A fault injected into a run. Faults of the exciter and of processes need a simulated rig."""

    name: str = Field(
        default="", pattern=r"^[^\x00-\x1f\x7f]*$", description="Name in events and verdicts; not given: TARGET KIND."
    )
    kind: str = Field(description="Kind of the fault: `stickslip fault --list` lists all kinds.")
    target: str = Field(description="A channel, sensors, exciter, clock, blocks, commands, link, or a process.")
    from_s: _Time = Field(default=0.0, description="Time of the run at which it begins.")
    for_s: _Time = Field(default=0.0, description="Duration; 0: to the end.")
    value: float | None = Field(default=None, description="Size of the fault; its meaning depends on the kind.")
    other: str = Field(default="", description="For `swapped`: the other channel.")

    @model_validator(mode="after")
    def _is_a_fault(self) -> "FaultTable":
        group = group_of(self.target)
        if group is None:
            known = ", ".join(target for targets in TARGETS.values() for target in targets)
            raise ValueError(f"target = {self.target}: no such target; known: {known}")
        kinds = [kind for of, kind in KINDS if of == group]
        if self.kind not in kinds:
            raise ValueError(f"kind = {self.kind}: must fit target = {self.target}; known for it: {', '.join(kinds)}")
        row = KINDS[(group, self.kind)]
        if not row.value:
            if self.value is not None:
                raise ValueError(f"value = {self.value:g}: kind = {self.kind} has none; leave it out")
        elif self.value is None and row.default is None:
            raise ValueError(f"value: missing; add it for kind = {self.kind}: {row.value}")
        elif not row.lowest <= self.size <= row.highest:
            rule = f"must be {row.lowest:g} to {row.highest:g} for kind = {self.kind} ({row.value})"
            raise ValueError(f"value = {self.size:g}: {rule}; change the value")
        if group == SENSORS and abs(self.size) > LARGEST:
            raise ValueError(f"value = {self.size:g}: must be within {LARGEST:g} either way, as a sample has 32 bits")
        if (self.kind == "swapped") != bool(self.other):
            raise ValueError(
                f"other = {self.other!r}: needed for kind = swapped, and only there; name the other channel"
            )
        if self.other and (self.other not in CHANNELS or self.target not in CHANNELS or self.other == self.target):
            raise ValueError(f"other = {self.other}: must be another channel than target; known: {', '.join(CHANNELS)}")
        if self.kind == "held" and not self.for_s:
            raise ValueError("for_s = 0: held messages must arrive at some time; give for_s")
        if group == PROCESS and self.kind == "frozen" and not self.for_s:
            raise ValueError("for_s = 0: a frozen process must continue at some time; give for_s, or kind = killed")
        return self

    @property
    def group(self) -> str:
        """The group of its target."""
        return group_of(self.target) or ""

    @property
    def size(self) -> float:
        """Its value, or the default of its kind; 0 for a kind without value."""
        return self.value if self.value is not None else KINDS[(self.group, self.kind)].default or 0.0

    @property
    def needs_time(self) -> bool:
        """Whether it has no meaning in lockstep, where each block waits for its command."""
        return self.group in {BUS, PROCESS}

    def in_words(self) -> str:
        """Name and short description."""
        size = f" {self.size:g}" if KINDS[(self.group, self.kind)].value else ""
        text = f"{self.target} {self.kind}{size}{f' with {self.other}' if self.other else ''}"
        return f"{self.name}: {text}" if self.name else text


def ordered(text: str) -> FaultTable:
    """The fault in a request. Raises Fault BAD_MESSAGE for a malformed request, CONFIG for an invalid fault of a rig."""
    try:
        table = json.loads(text) if len(text) < _LONGEST else None
    except (ValueError, RecursionError):
        table = None
    if not isinstance(table, dict):
        raise Fault("BAD_MESSAGE", f"{FAULT.name}: fault: is not a JSON object; send a table [[fault]]")
    made = validate(FaultTable, table, FAULT.name)
    if made.group == PROCESS:
        line = f"{FAULT.name}: target = {made.target}: a rig cannot end a process; must belong to sensors, exciter, clock or bus"
        raise Fault("CONFIG", f"{line}; end the process by its pid")
    return made
