"""The JSON Schemas of the bench: `python -m bench.schemas` writes them to bench/json_schemas."""

from pathlib import Path
from typing import Any, Literal

from bridge.files import write_json
from cockpit.commands.as_json.schemas import Format, result_of, scenario

FOLDER = Path(__file__).parent / "json_schemas"


def _bank() -> dict[str, Any]:
    from bench.control.scenario import BankConfig

    schema, bank = scenario(), BankConfig.model_json_schema()
    schema["$defs"] |= bank.pop("$defs") | {"BankConfig": bank}
    tables = {name: schema["properties"][name] for name in ("duration_s", "seed", "rig", "controller")}
    tables |= {"bank": {"$ref": "#/$defs/BankConfig"}}
    words = {name: {"type": "string"} for name in ("name", "description")}
    entry = {"type": "object", "properties": words | tables, "required": [*words], "additionalProperties": False}
    several = {
        "type": "array",
        "minItems": 1,
        "items": entry,
        "description": "Each entry starts from the tables above; its keys override them.",
    }
    return {
        "$defs": schema["$defs"],
        "type": "object",
        "properties": {"description": words["description"]} | tables | {"scenario": several},
        "required": ["description", "scenario"],
        "additionalProperties": False,
    }


def _blind_scores() -> dict[str, Any]:
    from bench.blind.pooling import FORMAT
    from bench.blind.scoring import Scores
    from cockpit.commands.as_json.types import objects, schema_of

    fields = {"format": Literal[FORMAT], "sealed": bool, "tool": str, "methods": dict[str, Scores]}
    return schema_of(objects("BlindScores", fields | {"cases": list[dict[str, Any]]}))


def _bench_control() -> dict[str, Any]:
    from bench.control.bars import Bar
    from bench.control.figures import Figures
    from bench.control.least import Least
    from cockpit.commands.as_json.types import objects, schema_of

    fields = {"passed": bool, "bars": list[Bar], "runs": list[Figures], "least": dict[str, Least]}
    fields |= {"step_cost_ratio": float, "elapsed_s": float}
    return schema_of(objects("BenchControl", fields))


def _bench_faults() -> dict[str, Any]:
    from bench.faults.run import FaultBench
    from cockpit.commands.as_json.types import schema_of, table

    return schema_of(table(FaultBench, {"counts": dict[str, int], "worse_than_known": list[str]}))


FORMATS = {
    form.name: form
    for form in (
        Format("bank", "A family of the bank of `python -m bench control`, as in bench/control/scenarios.", _bank),
        Format(
            "blind-scores-2",
            "`python -m bench blind score --json` and `blind pool --json`, blind-scores/2.",
            _blind_scores,
        ),
        Format("bench-control-result", "`python -m bench control --json`.", _bench_control),
        Format("bench-faults-result", "`python -m bench faults --json`.", _bench_faults),
        Format("blind-run-result", "`python -m bench blind run --json`.", result_of("bench.blind.command", "SetDone")),
    )
}


def main() -> None:
    """Write every schema."""
    for name, form in FORMATS.items():
        write_json(FOLDER / f"{name}.json", form.schema())


if __name__ == "__main__":
    main()
