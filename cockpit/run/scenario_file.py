"""Scenario and rig files as tables: their folders, the rig that a scenario names, and the bus.

The model of the rig, whose kernels take 0.5 s to load, is not imported: `stickslip stop` needs only the bus, and works even if
another table of the scenario is wrong.
"""

import json
from collections.abc import Mapping, Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, Self

from pydantic import Field, model_validator

from bridge.config import Strict, made_with, read_toml, validate, with_overrides
from bridge.faults import Fault
from bridge.wire.zenoh_link import BusConfig

SIMULATED = "sim"  # the adapter of a rig file that describes a simulated rig
RIG_FILE = "rig={file="  # prefix of a `--set` setting that replaces the scenario's rig file


class SweepTable(Strict):
    """Cases of a scenario, one for each value."""

    key: str = Field(
        default="", description="The key that changes, such as controller.limits.v_ratio or fault.0.value."
    )
    values: list[Any] | dict[str, Any] = Field(
        description="Values of the key, or a table of them with a name each; without a key each is a table of keys."
    )
    common: dict[str, Any] = Field(default={}, description="Further keys of the scenario, for all these values.")

    @model_validator(mode="after")
    def _has_keys(self) -> "SweepTable":
        if not self.key and not (
            isinstance(self.values, dict) and all(isinstance(row, dict) for row in self.values.values())
        ):
            raise ValueError("key: missing: values must then be tables of keys with a name each; add the key")
        if not self.values:
            raise ValueError("values: is empty: must have a value for each case; add one, or leave out [[sweep]]")
        return self

    def named(self) -> list[tuple[str, dict[str, Any]]]:
        """Name and keys of each case."""
        if not isinstance(self.values, dict):
            name = self.key.rpartition(".")[2]
            return [(f"{name}={value}".replace("/", "-"), {self.key: value}) for value in self.values]
        return [(name, {self.key: value} if self.key else value) for name, value in self.values.items()]


class Sweeps(Strict):
    """The tables `[[sweep]]` of a scenario."""

    sweep: list[SweepTable] = Field(
        default=[], description="Cases with other values, which `stickslip test` runs: a table `[[sweep]]` each."
    )

    @model_validator(mode="after")
    def _names_each_case_once(self) -> Self:
        names = [name for sweep in self.sweep for name, _ in sweep.named()]
        if twice := sorted({name for name in names if names.count(name) > 1}):
            raise ValueError(f"sweep: {twice[0]}: is used twice; give each case a different name")
        return self


class _BusTable(Strict):
    """The table `bus` of a scenario."""

    bus: BusConfig = BusConfig()


def deploy_folder() -> Path:
    """The folder of rigs and scenarios: inside an installed package, next to the packages in a checkout."""
    installed = Path(__file__).parents[1] / "deploy"
    return installed if installed.is_dir() else Path(__file__).parents[2] / "deploy"


def find(name: str, kind: str, key: str = "") -> Path:
    """Path of a scenario or rig: `name` is a .toml path or a shipped file; `key` begins the fault line. Raises Fault CONFIG."""
    given = Path(name)
    if given.suffix == ".toml":
        return given
    known = {path.stem: path for path in sorted((deploy_folder() / kind).glob("*.toml"))}
    if name not in known:
        raise Fault(
            "CONFIG",
            f"{key}{name}: no such {kind.removesuffix('s')}; known: {', '.join(known)}; or give the path of a .toml file",
        )
    return known[name]


def read_scenario(name: str) -> tuple[Path, dict[str, Any]]:
    """Path and table of a scenario by name or path; NAME:CASE is a case of its sweeps. Raises Fault CONFIG."""
    given, _, case = name.partition(":")
    path = find(given, "scenarios")
    table = {"name": path.stem} | read_toml(path)
    if not case:
        return path, table
    known = cases_of(path, table)
    if case not in known:
        near = get_close_matches(case, [*known], 3, 0.6)
        raise Fault("CONFIG", f"{name}: no such case; {'perhaps' if near else 'known:'} {', '.join(near or known)}")
    return path, with_overrides(table, known[case])


def cases_of(path: Path, table: dict[str, Any]) -> dict[str, list[str]]:
    """The settings of each case of the tables `[[sweep]]`, by its name. Raises Fault CONFIG."""
    sweeps = validate(Sweeps, {"sweep": table.get("sweep", [])}, path.name).sweep
    return {
        name: as_settings({"sweep": [], "name": name, **sweep.common}) + as_settings(keys)
        for sweep in sweeps
        for name, keys in sweep.named()
    }


def as_settings(tables: Mapping[str, Any], above: str = "") -> list[str]:
    """Settings `key=value` of tables in tables: {"controller": {"limits": {"v_ratio": 1.3}}}."""
    settings: list[str] = []
    for key, value in tables.items():
        place = f"{above}{key}"
        settings += as_settings(value, f"{place}.") if isinstance(value, Mapping) else [f"{place}={in_toml(value)}"]
    return settings


def in_toml(value: Any) -> str:
    """A value as TOML in one line."""
    if isinstance(value, Mapping):
        return "{" + ", ".join(f"{key} = {in_toml(inner)}" for key, inner in value.items()) + "}"
    if isinstance(value, list | tuple):
        return f"[{', '.join(map(in_toml, value))}]"
    return json.dumps(value, ensure_ascii=False)


def merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """A copy of `below` with the keys of `above` in place of its keys, table by table."""
    result = {} if above.get("absent") is True else dict(below)  # a channel that is absent has no source
    for key, value in above.items():
        inner = result.get(key)
        result[key] = merged(inner, value) if isinstance(inner, dict) and isinstance(value, dict) else value
    return result


def rig_table(path: Path) -> dict[str, Any]:
    """The table of a rig file. Raises Fault CONFIG."""
    table = read_toml(path)
    if "rig" in table:
        raise Fault("CONFIG", f"{path}: is a scenario, not a rig; give the rig that it names, or use --scenario")
    return table


def rig_setting(name: str) -> str:
    """The setting that replaces the rig of a scenario. Raises Fault CONFIG for an unknown name."""
    return f"{RIG_FILE}{json.dumps(str(find(name, 'rigs').resolve()), ensure_ascii=False)}}}"


def is_real_rig(rig: Any) -> bool:
    """Whether a table of a rig describes a real rig: it names an adapter."""
    return isinstance(rig, dict) and rig.get("adapter", SIMULATED) != SIMULATED


def path_of_rig(path: Path, table: dict[str, Any]) -> Path | None:
    """Path of the rig file that a scenario names; None without one. Raises Fault CONFIG for an unknown name."""
    rig = table.get("rig")
    if not isinstance(rig, dict) or "file" not in rig:
        return None
    name = str(rig["file"])
    relative = path.parent / name
    is_file = relative.suffix == ".toml" and relative.is_file()
    return relative if is_file else find(name, "rigs", f"{path.name}: rig.file: ")


def with_rig(path: Path, table: dict[str, Any]) -> tuple[dict[str, Any], str]:
    """The table of a scenario with the table of its rig file inside, and the names of both files."""
    rig = table.get("rig")
    rig_path = path_of_rig(path, table)
    if rig_path is None or not isinstance(rig, dict):
        return table, path.name
    overrides = {key: value for key, value in rig.items() if key != "file"}
    return table | {"rig": merged(rig_table(rig_path), overrides)}, f"{path.name} with {rig_path.name}"


def load_bus(name: str, settings: list[str]) -> BusConfig:
    """The bus of a scenario by name or path, with `bus.key=value` settings applied. Raises Fault CONFIG."""
    path, given = read_scenario(name)

    def bus(settings: Sequence[str]) -> BusConfig:
        table = with_overrides(given, settings)
        return validate(_BusTable, {key: table[key] for key in ("bus",) if key in table}, path.name).bus

    return made_with(bus, path.name, settings)
