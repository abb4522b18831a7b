"""The catalogue of faults: each case of the scenarios in deploy/faults."""

from pathlib import Path
from typing import NamedTuple

from bridge.config import read_toml, with_overrides
from bridge.faults import Fault
from bridge.rig.faults.kinds import KINDS, TARGETS, InjectionKind
from cockpit.run.scenario_file import cases_of, deploy_folder


class CatalogueEntry(NamedTuple):
    """One fault."""

    name: str
    group: str  # stem of its file
    about: str
    scenario: str  # FILE.toml:CASE


def load_catalogue(folder: Path | None = None) -> list[CatalogueEntry]:
    """All entries, file by file. Raises Fault CONFIG."""
    catalogue: list[CatalogueEntry] = []
    for path in sorted((folder or deploy_folder() / "faults").glob("*.toml")):
        table = read_toml(path)
        for name, settings in cases_of(path, table).items():
            about = str(with_overrides(table, settings)["description"])
            catalogue.append(CatalogueEntry(name, path.stem, about, f"{path}:{name}"))
    names = [row.name for row in catalogue]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise Fault("CONFIG", f"deploy/faults: {twice[0]}: is used twice; give each case a different name")
    return catalogue


def entry_names(incomplete: str) -> list[str]:
    """Names of entries that begin with `incomplete`, for shell completion."""
    return [row.name for row in load_catalogue() if row.name.startswith(incomplete)]


def find_entry(name: str) -> CatalogueEntry:
    """Entry by name. Raises Fault CONFIG."""
    catalogue = {row.name: row for row in load_catalogue()}
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
    return FaultList([KnownFault(row.name, row.group, row.about) for row in load_catalogue()], list(KINDS.values()))
