"""Scenario and rig files as tables: their folders, the rig that a scenario names, and the bus.

The model of the rig, whose kernels take 0.5 s to load, is not imported: `stickslip stop` needs only the bus, and works even if
another table of the scenario is wrong.
"""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bridge.config import Strict, made_with, read_toml, validate, with_overrides
from bridge.faults import Fault
from bridge.wire.zenoh_link import BusConfig

SIMULATED = "sim"  # the adapter of a rig file that describes a simulated rig
RIG_FILE = "rig={file="  # prefix of a `--set` setting that replaces the scenario's rig file


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


def merged(below: dict[str, Any], above: dict[str, Any]) -> dict[str, Any]:
    """A copy of `below` with the keys of `above` in place of its keys, table by table."""
    result = dict(below)
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
    path = find(name, "scenarios")
    given = read_toml(path)

    def bus(settings: Sequence[str]) -> BusConfig:
        table = with_overrides(given, settings)
        return validate(_BusTable, {key: table[key] for key in ("bus",) if key in table}, path.name).bus

    return made_with(bus, path.name, settings)
