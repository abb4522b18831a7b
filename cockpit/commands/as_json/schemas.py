"""Every TOML and JSON format of the project by name, each with its JSON Schema."""

from collections.abc import Callable
from typing import Any, Literal, NamedTuple, NotRequired

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


def _controller() -> dict[str, Any]:
    from controller.config import ControllerConfig

    return ControllerConfig.model_json_schema()


def _evidence() -> dict[str, Any]:
    from diagnosis.evidence.manifest import Manifest

    schema = Manifest.model_json_schema()
    return _with_channels(schema)


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
    rig |= (
        {
            "required": [
                name for name in rig["required"] if not name.startswith(("contact", "viscous", "mass", "stribeck"))
            ]
        }
        if "required" in rig
        else {}
    )
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


def _diagnosis_type() -> Any:
    from cockpit.commands.as_json.types import table
    from diagnosis.result import FORMAT, Candidate, Diagnosis, Estimate

    candidate = table(Candidate, {"form": NotRequired[str], "parameters": NotRequired[dict[str, Estimate]]})
    return table(Diagnosis, {"format": Literal[FORMAT], "candidates": list[candidate]}, left_out=("pictures",))


def _diagnosis() -> dict[str, Any]:
    from cockpit.commands.as_json.types import schema_of

    return schema_of(_diagnosis_type())


def _diagnoses() -> dict[str, Any]:
    from cockpit.commands.as_json.types import objects, schema_of
    from cockpit.commands.diagnose_output import MANY_FORMAT

    fault = objects("FolderFault", {"fault": str, "line": str})
    folder = {"evidence": str, "diagnosis": NotRequired[_diagnosis_type()], "fault": NotRequired[fault]}
    return schema_of(objects("Diagnoses", {"format": Literal[MANY_FORMAT], "results": list[objects("Folder", folder)]}))


def _fault() -> dict[str, Any]:
    from cockpit.commands.as_json.types import objects, schema_of

    return schema_of(objects("Fault", {"fault": str, "line": str, "exit_status": int}))


def _verdict(**more: Any) -> Any:
    """The type of a verdict, with more fields."""
    from cockpit.commands.as_json.types import table
    from cockpit.judge.verdict import NOT_JUDGED, NOT_OK, OK, RunVerdict

    words = dict.fromkeys(("headline", "reason", "data"), str)
    lists = dict.fromkeys(("trips", "injected", "warnings"), list[str])
    return table(RunVerdict, {"good": bool, "control": Literal[OK, NOT_OK, NOT_JUDGED]} | words | lists | more)


def _run() -> dict[str, Any]:
    from cockpit.commands.as_json.types import schema_of
    from cockpit.judge.margins import Margins
    from cockpit.judge.phases import Phase

    more = {"effects": NotRequired[list[str]], "loop": NotRequired[Margins], "without": NotRequired[Phase]}
    return schema_of(_verdict(rig=str, **more))


def _log_info() -> dict[str, Any]:
    from bridge.log.finding import Finding
    from cockpit.commands.as_json.types import objects, schema_of

    one = _verdict(findings=list[Finding])
    fault = objects("LogFault", {"fault": str, "line": str, "exit_status": int})
    return schema_of(one | list[one | fault])


def _plot() -> dict[str, Any]:
    from cockpit.commands.as_json.types import schema_of

    return schema_of(_verdict(picture=str, data=str | None))


def _review() -> dict[str, Any]:
    from cockpit.commands.as_json.types import objects, schema_of

    return schema_of(objects("Review", {"page": str, "logs": list[_verdict()]}))


def _look() -> dict[str, Any]:
    from bridge.log.finding import Finding
    from cockpit.commands.as_json.types import objects, schema_of

    number = objects("Number", {"value": float, "interval_90": list[float | None], "unit": str})
    of_speed = {"speed_mps": float, "times": int, "mean_N": number, "breakaway_N": number | None}
    fields = {
        "headline": str,
        "seconds": float,
        "rate_Hz": float,
        "noise_N": float,
        "slips": int,
        "swings_without_stick": int,
        "mean_force_N": float,
        "numbers": dict[str, number],
        "at_speeds": list[objects("AtSpeed", of_speed)],
        "findings": list[Finding],
        "written": list[str],
    }
    return schema_of(objects("Look", fields))


def _log_recover() -> dict[str, Any]:
    from bridge.log.damage import Damage
    from cockpit.commands.as_json.types import schema_of, table

    return schema_of(table(Damage, {"messages": int, "attachments": int, "out": str}))


def _explain() -> dict[str, Any]:
    from bridge.wire.event_codes import EventCode
    from bridge.wire.words import ColumnWord
    from cockpit.commands.as_json.types import schema_of
    from cockpit.commands.explain import Meaning

    return schema_of(list[Meaning | ColumnWord | EventCode])


def _reproduce() -> dict[str, Any]:
    from cockpit.commands.as_json.types import schema_of, table
    from cockpit.paper.page import ReproduceResult

    return schema_of(table(ReproduceResult, {"passed": bool, "verdict": str}))


def _faults() -> dict[str, Any]:
    from cockpit.faults.catalogue import FaultGroup

    return FaultGroup.model_json_schema()


def _soak() -> dict[str, Any]:
    from cockpit.commands.as_json.types import schema_of
    from cockpit.run.soak import Memory, Period

    more = {"scenario": str, "wanted_s": float, "interrupted": bool, "memory": list[Memory], "periods": list[Period]}
    return schema_of(_verdict(**more))


def result_of(module: str, kind: str, many: bool = False) -> Callable[[], dict[str, Any]]:
    """The schema of a command whose result is a named tuple, or a list of named tuples."""

    def make() -> dict[str, Any]:
        from importlib import import_module

        from cockpit.commands.as_json.types import schema_of

        made = getattr(import_module(module), kind)
        return schema_of(list[made] if many else made)

    return make


TOML = (
    Format("rig", "A rig file, as in deploy/rigs: `--rig FILE.toml`.", _rig),
    Format("scenario", "A scenario file, as in deploy/scenarios: `--scenario FILE.toml`.", scenario),
    Format("faults", "A group of the catalogue of `python -m bench faults`, as in deploy/faults.", _faults),
    Format("controller", "The table [controller] of a scenario, and the configuration in a log.", _controller),
    Format("evidence-1", "manifest.toml of an evidence folder, evidence/1.", _evidence),
    Format("import-map", "A channel map: `stickslip log import --map FILE.toml`.", _import_map),
)
JSON = (
    Format("diagnosis-2", "`stickslip diagnose FOLDER --json`, diagnosis/2.", _diagnosis),
    Format("diagnoses-2", "`stickslip diagnose --json` of several folders, diagnoses/2.", _diagnoses),
    Format(
        "fleet-1",
        "index.json that `stickslip diagnose --report DIR` of several folders writes.",
        result_of("cockpit.fleet.groups", "Fleet"),
    ),
    Format("fault", "Any command that fails with JSON on stdout.", _fault),
    Format("run-result", "`stickslip run --json`.", _run),
    Format("plant-result", "`stickslip plant --json`.", result_of("cockpit.commands.processes", "Served")),
    Format("controller-result", "`stickslip controller --json`.", result_of("cockpit.commands.processes", "Served")),
    Format("record-result", "`stickslip record --json`.", result_of("cockpit.commands.processes", "Recorded")),
    Format("status-result", "`stickslip status --json`.", result_of("cockpit.run.status", "Status")),
    Format(
        "word-result",
        "`stickslip arm --json`; disarm, stop and reset print the same format.",
        result_of("cockpit.run.operator", "CommandOutcome"),
    ),
    Format("fault-result", "`stickslip fault --json`.", result_of("cockpit.faults.injection", "Injected")),
    Format("fault-list", "`stickslip fault --list --json`.", result_of("cockpit.faults.catalogue", "FaultList")),
    Format("soak-result", "`stickslip soak --json`.", _soak),
    Format("certs-result", "`stickslip certs --json`.", result_of("cockpit.run.authority", "Made")),
    Format("replay-result", "`stickslip replay --json`.", result_of("cockpit.run.replay", "Replayed", many=True)),
    Format(
        "closed-loop-result", "`stickslip replay --closed-loop --json`.", result_of("cockpit.run.replay", "Compared")
    ),
    Format("plot-result", "`stickslip plot --json`.", _plot),
    Format("review-result", "`stickslip review --json`.", _review),
    Format("look-result", "`stickslip look --json`.", _look),
    Format("map-result", "`stickslip map --json`.", result_of("cockpit.judge.stability_map", "MapResult")),
    Format("reproduce-result", "`stickslip reproduce --json`.", _reproduce),
    Format("example-result", "`stickslip example --json`.", result_of("cockpit.commands.example", "Example")),
    Format("log-info-result", "`stickslip log info --json`; of several logs a list.", _log_info),
    Format("log-check-result", "`stickslip log check --json`.", result_of("bridge.log.check.log_check", "LogCheck")),
    Format("log-recover-result", "`stickslip log recover --json`.", _log_recover),
    Format("log-export-result", "`stickslip log export --json`.", result_of("bridge.tables.export", "Exported")),
    Format(
        "log-import-result", "`stickslip log import --json`.", result_of("diagnosis.evidence.import_table", "Imported")
    ),
    Format("scenarios-result", "`stickslip scenarios --json`.", result_of("cockpit.commands.scenarios", "Shipped")),
    Format("explain-result", "`stickslip explain --json`.", _explain),
    Format(
        "schema-result", "`stickslip schema --json`.", result_of("cockpit.commands.schema", "SchemaName", many=True)
    ),
)
FORMATS = {row.name: row for row in (*TOML, *JSON)}
