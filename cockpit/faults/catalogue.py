"""The entries of deploy/faults/*.toml: a group each, with what its entries have in common and the entries."""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import Field, model_validator

from bridge.config import Strict, read_toml, validate
from bridge.faults import Fault
from cockpit.run.scenario_file import deploy_folder
from plant.faults.kinds import ALL, TARGETS, Kind
from plant.faults.table import FaultTable

NotNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]


class Said(Strict):
    """A person's word during a run."""

    word: Literal["STOP", "RESET", "ARM", "DISARM", "ACCEPT_GAIN"]
    at_s: NotNegative = Field(default=0.0, description="After the entry's begin.")


class Entry(Strict):
    """One named fault, and what must come of it. Each must be bounded: v_a above 1.5 times its set point for 0.2 s at most."""

    name: str
    about: str
    fault: list[FaultTable] = Field(default=[], description="Their times count from the entry's begin.")
    scenario: str = "from-the-start"
    settings: list[str] = Field(default=[], description="key=value each, beside those of the group.")
    said: list[Said] = []
    checked: bool = Field(default=True, description="Armed by a person, with a loop check; false: by its scenario.")
    begin_s: NotNegative = Field(default=2.5, description="Of the run; the loop check ends at 1.6 s.")
    watch_s: Positive = Field(default=4.0, description="How long after its begin it is judged.")
    told: list[str] | None = Field(
        default=None,
        description="Events, causes or reasons, one of which must be said; not given: those of the group; none: "
        "it must be without effect.",
    )
    within_s: Positive = Field(default=1.0, description="In which it must be said.")
    zero_s: Positive | None = Field(default=None, description="After which nothing may vibrate, to the end.")
    open: Literal["", "SILENT", "UNSAFE"] = Field(
        default="", description="What is known to come of it, until it is mended."
    )


class Group(Strict):
    """One file of the catalogue."""

    about: str
    told: list[str] = []
    settings: list[str] = []
    entry: list[Entry]

    @model_validator(mode="after")
    def _names_differ(self) -> "Group":
        names = [one.name for one in self.entry]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"entry.name = {twice[0]}: is there twice; give each its own")
        return self


class Named(Strict):
    """An entry with its group."""

    group: str
    entry: Entry
    told: list[str]
    settings: list[str]

    @property
    def faults(self) -> list[FaultTable]:
        """Its tables with the times of the run."""
        entry = self.entry
        return [
            one.model_copy(update={"name": one.name or entry.name, "from_s": entry.begin_s + one.from_s})
            for one in entry.fault
        ]


def load_catalogue(folder: Path | None = None) -> list[Named]:
    """Every entry, group by group. Raises Fault CONFIG."""
    found: list[Named] = []
    for path in sorted((folder or deploy_folder() / "faults").glob("*.toml")):
        group = validate(Group, read_toml(path), path.name)
        for entry in group.entry:
            told = group.told if entry.told is None else entry.told
            settings = [*group.settings, *entry.settings]
            found.append(Named(group=path.stem, entry=entry, told=told, settings=settings))
    names = [one.entry.name for one in found]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise Fault("CONFIG", f"deploy/faults: name = {twice[0]}: is in two files; give each entry its own")
    return found


def chosen(catalogue: Sequence[Named], only: Sequence[str]) -> list[Named]:
    """The entries of groups, or whose names begin so; all of them if nothing is asked for. Raises Fault CONFIG."""
    if not only:
        return list(catalogue)
    found = [one for one in catalogue if any(one.group == word or one.entry.name.startswith(word) for word in only)]
    for word in only:
        if not any(one.group == word or one.entry.name.startswith(word) for one in catalogue):
            groups = ", ".join(dict.fromkeys(one.group for one in catalogue))
            raise Fault("CONFIG", f"--only {word}: no such group and no such entry; groups: {groups}")
    return found


def find_entry(name: str) -> Named:
    """An entry by its name. Raises Fault CONFIG."""
    catalogue = load_catalogue()
    found = next((one for one in catalogue if one.entry.name == name), None)
    if found is None:
        names = [one.entry.name for one in catalogue]
        near = ", ".join(one for one in names if one.startswith(name.partition("-")[0]))
        raise Fault(
            "CONFIG", f"{name}: no such fault; {f'perhaps {near}; ' if near else ''}see `stickslip fault --list`"
        )
    return found


class KnownFault(NamedTuple):
    """An entry, for a list."""

    name: str
    group: str
    about: str


class Known(NamedTuple):
    """The catalogue, and every kind of fault that a scenario may have."""

    faults: list[KnownFault]
    kinds: list[Kind]

    def in_words(self) -> list[str]:
        """Lines for a person."""
        lines = [f"{one.name:<32} {one.about}" for one in self.faults]
        lines += ["", "kinds of [[fault]], by target:"]
        for group, targets in TARGETS.items():
            lines.append(f"  {', '.join(targets)}")
            for one in (kind for kind in self.kinds if kind.group == group):
                lines.append(f"    {one.kind:<12} {one.help}{f'; value: {one.value}' if one.value else ''}")
        return lines


def known_faults() -> Known:
    """All of it. Raises Fault CONFIG."""
    return Known([KnownFault(one.entry.name, one.group, one.entry.about) for one in load_catalogue()], list(ALL))
