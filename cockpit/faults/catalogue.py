"""Entries of deploy/faults/*.toml: each file is a group, with common settings and its entries."""

from pathlib import Path
from typing import Annotated, Literal, NamedTuple

from pydantic import Field

from bridge.config import Strict, read_toml, validate
from bridge.faults import Fault
from bridge.rig.faults.kinds import KINDS, TARGETS, InjectionKind
from bridge.rig.faults.table import FaultTable
from cockpit.run.scenario_file import deploy_folder

NotNegative = Annotated[float, Field(ge=0)]
Positive = Annotated[float, Field(gt=0)]


class OperatorAction(Strict):
    """An operator command during a run."""

    word: Literal["STOP", "RESET", "ARM", "DISARM", "ACCEPT_GAIN"]
    at_s: NotNegative = Field(default=0.0, description="Time after begin_s.")


class NamedFault(Strict):
    """One named fault with the required reaction. v_a may exceed 1.5 times its set point for 0.2 s at most."""

    name: str
    about: str
    fault: list[FaultTable] = Field(default=[], description="Their times count from begin_s.")
    scenario: str = "from-the-start"
    settings: list[str] = Field(default=[], description="key=value each, in addition to the settings of the group.")
    said: list[OperatorAction] = []
    checked: bool = Field(
        default=True, description="Armed by an operator, with a loop check; false: armed by its scenario."
    )
    begin_s: NotNegative = Field(default=2.5, description="Begin in the run; the loop check ends at 1.8 s.")
    watch_s: Positive = Field(default=4.0, description="Time from begin_s during which the entry is judged.")
    told: list[str] | None = Field(
        default=None,
        description="Events, causes or reasons, at least one of which must be reported; default: the list of the group; "
        "empty: the fault must have no effect.",
    )
    within_s: Positive = Field(default=1.0, description="Time limit for the report, from begin_s.")
    zero_s: Positive | None = Field(default=None, description="Time from begin_s after which nothing may vibrate.")
    open: Literal["", "SILENT", "UNSAFE"] = Field(default="", description="Known defect that this entry still shows.")


class FaultGroup(Strict):
    """One file of the catalogue."""

    about: str
    told: list[str] = []
    settings: list[str] = []
    entry: list[NamedFault]


class CatalogueEntry(Strict):
    """An entry, with the reports and settings that apply to it, which include the settings of its group."""

    group: str
    entry: NamedFault
    told: list[str]
    settings: list[str]


def load_catalogue(folder: Path | None = None) -> list[CatalogueEntry]:
    """All entries, group by group. Raises Fault CONFIG."""
    catalogue: list[CatalogueEntry] = []
    for path in sorted((folder or deploy_folder() / "faults").glob("*.toml")):
        group = validate(FaultGroup, read_toml(path), path.name)
        for entry in group.entry:
            reports = group.told if entry.told is None else entry.told
            settings = [*group.settings, *entry.settings]
            catalogue.append(CatalogueEntry(group=path.stem, entry=entry, told=reports, settings=settings))
    names = [named.entry.name for named in catalogue]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise Fault("CONFIG", f"deploy/faults: name = {twice[0]}: is used twice; give each entry a different name")
    return catalogue


def entry_names(incomplete: str) -> list[str]:
    """Names of entries that begin with `incomplete`, for shell completion."""
    return [named.entry.name for named in load_catalogue() if named.entry.name.startswith(incomplete)]


def find_entry(name: str) -> CatalogueEntry:
    """Entry by name. Raises Fault CONFIG."""
    catalogue = {named.entry.name: named for named in load_catalogue()}
    if name not in catalogue:
        near = ", ".join(known for known in catalogue if known.startswith(name.partition("-")[0]))
        perhaps = f"perhaps {near}; " if near else ""
        raise Fault("CONFIG", f"{name}: no such fault; {perhaps}see `stickslip fault --list`")
    return catalogue[name]


class KnownFault(NamedTuple):
    """Row of the list of the catalogue."""

    name: str
    group: str
    about: str


class FaultList(NamedTuple):
    """The catalogue, and all kinds of fault for scenarios."""

    faults: list[KnownFault]
    kinds: list[InjectionKind]

    def in_words(self) -> list[str]:
        """Lines for the operator: the entries, then the kinds of fault by target."""
        lines = [f"{fault.name:<32} {fault.about}" for fault in self.faults]
        lines += ["", "kinds of [[fault]], by target:"]
        for group, targets in TARGETS.items():
            lines.append(f"  {', '.join(targets)}")
            for kind in (kind for kind in self.kinds if kind.group == group):
                lines.append(f"    {kind.kind:<12} {kind.help}{f'; value: {kind.value}' if kind.value else ''}")
        return lines


def known_faults() -> FaultList:
    """All known faults. Raises Fault CONFIG."""
    return FaultList(
        [KnownFault(row.entry.name, row.group, row.entry.about) for row in load_catalogue()], list(KINDS.values())
    )
