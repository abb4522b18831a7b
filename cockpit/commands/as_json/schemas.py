"""Every TOML and JSON format of the project by name, each with its JSON Schema."""

from collections.abc import Callable
from importlib import import_module
from typing import Any, NamedTuple

DIALECT = "https://json-schema.org/draft/2020-12/schema"


class Format(NamedTuple):
    """One kind of file or result."""

    name: str
    about: str
    make: Callable[[], dict[str, Any]]

    def schema(self) -> dict[str, Any]:
        """The JSON Schema of this format."""
        return {"$schema": DIALECT, "title": self.name} | _untitled(self.make()) | {"description": self.about}


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


def result_of(place: str) -> Callable[[], dict[str, Any]]:
    """The schema of a result or a table, from the place `module:name` of its type."""

    def make() -> dict[str, Any]:
        from cockpit.commands.as_json.types import schema_of

        module, _, name = place.partition(":")
        return schema_of(getattr(import_module(module), name))

    return make


def _log_info() -> dict[str, Any]:
    from cockpit.commands.as_json.types import schema_of
    from cockpit.judge.judged import Judged
    from cockpit.run.child_process import ReportedFault

    return schema_of(Judged | list[Judged | ReportedFault])


_RESULTS = {
    "run": "cockpit.run.outcome:RunOutcome",
    "plant": "cockpit.commands.processes:Served",
    "controller": "cockpit.commands.processes:Served",
    "record": "cockpit.commands.processes:Recorded",
    "status": "cockpit.live.status:Status",
    "fault": "cockpit.faults.injection:Injected",
    "soak": "cockpit.run.soak:Soaked",
    "certs": "cockpit.run.authority:Made",
    "replay": "cockpit.run.replay:ReplayResult",
    "plot": "cockpit.figures.run_figure:Plotted",
    "review": "cockpit.review.page:Reviewed",
    "look": "cockpit.look.result:Looked",
    "map": "cockpit.figures.stability_map:MapResult",
    "reproduce": "cockpit.paper.page:ReproduceResult",
    "example": "cockpit.commands.example:Example",
    "log check": "bridge.log.check.log_check:LogCheck",
    "log recover": "bridge.log.recover:Recovered",
    "log export": "bridge.tables.export:Exported",
    "log import": "diagnosis.evidence.import_table:Imported",
    "scenarios": "cockpit.commands.scenarios:Shipped",
    "explain": "cockpit.commands.explain:Explained",
    "schema": "cockpit.commands.schema:SchemaNames",
}
TOML = (
    Format("rig", "A rig file, as in deploy/rigs: `--rig FILE.toml`.", _rig),
    Format("scenario", "A scenario file, as in deploy/scenarios: `--scenario FILE.toml`.", scenario),
    Format(
        "faults",
        "A group of the catalogue of `python -m bench faults`, as in deploy/faults.",
        result_of("cockpit.faults.catalogue:FaultGroup"),
    ),
    Format(
        "controller",
        "The table [controller] of a scenario, and the configuration in a log.",
        result_of("controller.config:ControllerConfig"),
    ),
    Format("evidence-1", "manifest.toml of an evidence folder, evidence/1.", _evidence),
    Format("import-map", "A channel map: `stickslip log import --map FILE.toml`.", _import_map),
)
JSON = (
    Format("diagnosis-2", "`stickslip diagnose FOLDER --json`, diagnosis/2.", result_of("diagnosis.result:Diagnosis")),
    Format(
        "diagnoses-2",
        "`stickslip diagnose --json` of several folders, diagnoses/2.",
        result_of("cockpit.commands.diagnose_output:Diagnoses"),
    ),
    Format(
        "fleet-1",
        "index.json that `stickslip diagnose --report DIR` of several folders writes.",
        result_of("cockpit.fleet.groups:Fleet"),
    ),
    Format(
        "fault", "Any command that fails with JSON on stdout.", result_of("cockpit.run.child_process:ReportedFault")
    ),
    Format(
        "word-result",
        "`stickslip arm --json`; disarm, stop and reset print the same format.",
        result_of("cockpit.live.operator:CommandOutcome"),
    ),
    Format("fault-list", "`stickslip fault --list --json`.", result_of("cockpit.faults.catalogue:FaultList")),
    Format("closed-loop-result", "`stickslip replay --closed-loop --json`.", result_of("cockpit.run.replay:Compared")),
    Format("log-info-result", "`stickslip log info --json`; of several logs a list.", _log_info),
    *(
        Format(f"{command.replace(' ', '-')}-result", f"`stickslip {command} --json`.", result_of(place))
        for command, place in _RESULTS.items()
    ),
)
FORMATS = {row.name: row for row in (*TOML, *JSON)}
