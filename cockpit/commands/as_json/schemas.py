"""Every TOML and JSON format of the project by name, each with its JSON Schema."""

import types
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, Literal, NamedTuple, NotRequired, Union, get_args, get_origin, get_type_hints

from pydantic import ConfigDict, TypeAdapter
from typing_extensions import TypedDict  # pydantic refuses typing.TypedDict before Python 3.12

from bridge.results import json_names

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class Format(NamedTuple):
    """One format: a kind of TOML file, or of JSON result."""

    name: str
    about: str
    source: (
        Callable[[], dict[str, Any]] | str
    )  # a function that makes the schema, or `module:name` of the type from which the schema is derived

    def schema(self) -> dict[str, Any]:
        """The JSON Schema of this format."""
        if isinstance(self.source, str):
            module, _, name = self.source.partition(":")
            made = schema_of(getattr(import_module(module), name))
        else:
            made = self.source()
        return {"$schema": DIALECT, "title": self.name} | _untitled(made) | {"description": self.about}


def _untitled(schema: Any) -> Any:
    """Remove the titles that pydantic derives from the names."""
    if isinstance(schema, list):
        return [_untitled(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    return {key: _untitled(value) for key, value in schema.items() if key != "title" or not isinstance(value, str)}


# TOML: a schema accepts every file that the models accept; the models check more than a schema can express


def _rig() -> dict[str, Any]:
    from plant.config import RigConfig

    schema = RigConfig.model_json_schema()
    contact = schema["$defs"]["ContactConfig"]
    contact["anyOf"] = [{"required": ["pair"]}, {"required": contact.pop("required")}]
    return _with_pairs_and_effects(schema)


def scenario() -> dict[str, Any]:
    """The schema of a scenario file."""
    from cockpit.run.scenario import Scenario

    schema = Scenario.model_json_schema()
    known = schema["$defs"]
    # `file` names a rig; the other keys of the table override keys of that rig
    del known["ContactConfig"]["required"], known["RigConfig"]["required"]
    file = {
        "type": "string",
        "description": "Name of a rig in deploy/rigs, or a .toml file; the other keys here override its keys.",
    }
    known["RigConfig"]["properties"] = {"file": file} | known["RigConfig"]["properties"]
    # a sweep may give the rig of each case
    schema["anyOf"] = [{"required": schema.pop("required")}, {"required": ["sweep"]}]
    return _with_pairs_and_effects(schema)


def _with_pairs_and_effects(schema: dict[str, Any]) -> dict[str, Any]:
    from plant.effects.library import EFFECTS
    from plant.effects.row import Formula
    from plant.pairs import PAIRS

    def form(name: str, formula: Formula, first: bool) -> dict[str, Any]:
        numbers = {
            row.name: {"type": "number", "minimum": row.low, "maximum": row.high, "default": row.default}
            for row in formula.parameters
        }
        needed = {} if first else {"required": ["form"]}
        word = {"const": name, "description": formula.formula}
        return {"type": "object", "properties": {"form": word} | numbers, "additionalProperties": False} | needed

    schema["$defs"]["ContactConfig"]["properties"]["pair"]["enum"] = ["", *PAIRS]
    rig = schema["$defs"].get("RigConfig", schema)
    rig["properties"]["effects"] |= {
        "properties": {
            name: {"anyOf": [form(*item, first=number == 0) for number, item in enumerate(effect.forms.items())]}
            for name, effect in EFFECTS.items()
        },
        "additionalProperties": False,
    }
    return schema


def _evidence() -> dict[str, Any]:
    from diagnosis.evidence.manifest import Manifest

    return _with_channels(Manifest.model_json_schema())


def _import_map() -> dict[str, Any]:
    from diagnosis.evidence.import_table import ImportMap
    from diagnosis.evidence.manifest import RigTable

    schema = ImportMap.model_json_schema()
    rig = RigTable.model_json_schema()
    del rig["required"]  # an import into a log needs no number of the rig; unknown numbers are assumed
    schema["$defs"]["RigTable"] = rig
    schema["properties"]["rig"] = {"$ref": "#/$defs/RigTable"}
    return _with_channels(schema)


def _with_channels(schema: dict[str, Any]) -> dict[str, Any]:
    from diagnosis.evidence.manifest import RigTable
    from diagnosis.evidence.manifest_keys import STANDARD

    column = {"type": "string", "minLength": 1, "description": "Name of the column."}
    number = {"type": "integer", "minimum": 1, "description": "Number of the column, from 1 on."}
    channel = {"anyOf": [column, number, {"$ref": "#/$defs/ChannelMap"}]}
    of_channel = schema["$defs"]["ChannelMap"]["properties"]
    of_channel["column"] = {"anyOf": [of_channel["column"], number]}
    tables = [schema, schema["$defs"]["RunTable"]] if "RunTable" in schema["$defs"] else [schema]
    for table in tables:
        channels = table["properties"]["channels"]
        channels |= {"properties": dict.fromkeys(STANDARD, channel), "additionalProperties": False}
    rig = schema["$defs"]["RigTable"]
    # numbers that the owner of a rig rarely knows are optional; the diagnosis assumes them
    rarely_known = ("contact", "viscous", "mass", "stribeck")
    if "required" in rig:
        rig["required"] = [name for name in rig["required"] if not name.startswith(rarely_known)]
    numbers = [
        name
        for name in RigTable.model_fields
        if name not in {"drive", "tolerance", "radius_m", "force_per_current_N_per_A"}
    ]
    tolerance = rig["properties"]["tolerance"]
    share = {"type": "number", "minimum": 0.0, "maximum": 1.0}
    tolerance |= {"properties": dict.fromkeys(numbers, share), "additionalProperties": False}
    return schema


# JSON: from the types of the results


def _log_info() -> dict[str, Any]:
    from cockpit.judge.judged import Judged
    from cockpit.run.child_process import ReportedFault

    return schema_of(Judged | list[Judged | ReportedFault])


_RESULTS = {
    "run": "cockpit.judge.judged:RunOutcome",
    "plant": "cockpit.commands.processes:Served",
    "controller": "cockpit.commands.processes:Served",
    "record": "cockpit.commands.processes:Recorded",
    "rig serve": "cockpit.commands.processes:Served",
    "rig check": "bridge.rig.check:RigCheck",
    "rig conformance": "bridge.rig.conformance.report:Conformance",
    "rig box": "cockpit.commands.rig:Boxed",
    "rig release": "cockpit.commands.rig:Released",
    "status": "cockpit.live.status:Status",
    "fault": "cockpit.faults.injection:Injected",
    "fmu": "bridge.fmu.export:Exported",
    "test": "cockpit.testing.suite:Suite",
    "soak": "cockpit.run.soak:Soaked",
    "certs": "cockpit.run.authority:Made",
    "replay": "cockpit.run.replay:ReplayResult",
    "plot": "cockpit.figures.run_figure:Plotted",
    "review": "cockpit.review.page:Reviewed",
    "look": "cockpit.look.pieces:Looked",
    "map": "cockpit.figures.stability_map:MapResult",
    "reproduce": "cockpit.paper.page:ReproduceResult",
    "example": "cockpit.commands.example:Example",
    "log check": "bridge.log.check.log_check:LogCheck",
    "log recover": "bridge.log.recover:Recovered",
    "log export": "bridge.tables.export:Exported",
    "log import": "diagnosis.evidence.import_table:Imported",
    "scenarios": "cockpit.commands.scenarios:ScenariosResult",
    "explain": "cockpit.commands.explain:Explained",
    "schema": "cockpit.commands.proof:SchemaNames",
}
TOML = (
    Format("rig", "A rig file of a simulated rig, as in deploy/rigs: `--rig FILE.toml`.", _rig),
    Format(
        "scenario",
        "A scenario file, as in deploy/scenarios, deploy/tests and deploy/faults: `--scenario FILE.toml`.",
        scenario,
    ),
    Format(
        "real-rig", "A rig file of a real rig: `--rig FILE.toml`, `stickslip rig check`.", "bridge.rig.file:DeviceRig"
    ),
    Format("box", "A simulated device: `stickslip rig box FILE.toml`.", "plant.rig.box:BoxConfig"),
    Format(
        "controller",
        "The table [controller] of a scenario, and the configuration in a log.",
        "controller.config:ControllerConfig",
    ),
    Format("evidence-1", "manifest.toml of an evidence folder, evidence/1.", _evidence),
    Format("import-map", "A channel map: `stickslip log import --map FILE.toml`.", _import_map),
)
JSON = (
    Format("diagnosis-3", "`stickslip diagnose FOLDER --json`, diagnosis/3.", "diagnosis.result:Diagnosis"),
    Format(
        "diagnoses-3",
        "`stickslip diagnose --json` of several folders, diagnoses/3.",
        "cockpit.commands.diagnose_output:Diagnoses",
    ),
    Format(
        "fleet-1",
        "index.json that `stickslip diagnose --report DIR` of several folders writes.",
        "cockpit.fleet.groups:Fleet",
    ),
    Format("fault", "Any command that fails with JSON on stdout.", "cockpit.run.child_process:ReportedFault"),
    Format(
        "word-result",
        "`stickslip arm --json`; disarm, stop and reset print the same format.",
        "cockpit.live.operator:CommandOutcome",
    ),
    Format("fault-list", "`stickslip fault --list --json`.", "cockpit.faults.catalogue:FaultList"),
    Format("closed-loop-result", "`stickslip replay --closed-loop --json`.", "cockpit.run.replay:Compared"),
    Format("log-info-result", "`stickslip log info --json`; of several logs a list.", _log_info),
    *(
        Format(f"{command.replace(' ', '-')}-result", f"`stickslip {command} --json`.", place)
        for command, place in _RESULTS.items()
    ),
)
FORMATS = {row.name: row for row in (*TOML, *JSON)}


def schema_of(kind: Any) -> dict[str, Any]:
    """JSON Schema of the JSON that `bridge.results.strict_json` makes of a value of type `kind`."""
    return TypeAdapter[Any](_written(kind)).json_schema()


def _written(kind: Any) -> Any:
    """The type of the JSON for a type: an object for a named tuple, a list for a tuple, null for NaN and infinity."""
    if kind is float:
        return float | None
    if kind is Path:
        return str
    if hasattr(kind, "_fields"):
        return _object(kind)
    origin, inner = get_origin(kind), get_args(kind)
    if origin is None or origin is Literal:
        return kind
    if origin is tuple and inner[1:] == (Ellipsis,):
        return list[_written(inner[0])]
    plain = tuple(_written(part) for part in inner)
    if origin in (Union, types.UnionType):
        return Union[plain]  # noqa: UP007 (made of a list)
    generic: Any = origin
    return generic[plain]


@cache
def _object(kind: Any) -> Any:
    make: Any = TypedDict
    made = make(kind.__name__, _entries(kind))
    made.__pydantic_config__ = ConfigDict(extra="forbid")
    return made


def _entries(kind: Any) -> dict[str, Any]:
    """Types of the entries of a named tuple's JSON, by name."""
    hints = get_type_hints(kind)
    optional, merged = getattr(kind, "JSON_OPTIONAL", ()), getattr(kind, "JSON_MERGED", "")
    entries = _entries(hints[merged]) if merged else {}
    for name in json_names(kind):
        hint = hints[name] if name in hints else get_type_hints(getattr(kind, name).fget)["return"]
        if name in optional:
            present = [part for part in get_args(hint) if part is not types.NoneType]
            entries[name] = NotRequired[_written(present[0] if types.NoneType in get_args(hint) else hint)]
        else:
            entries[name] = _written(hint)
    return entries
