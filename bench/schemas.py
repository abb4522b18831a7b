"""The JSON Schemas of the bench: `python -m bench.schemas` writes them to bench/json_schemas."""

from pathlib import Path
from typing import Any

from bridge.results import write_json
from cockpit.commands.as_json.schemas import Format, scenario

FOLDER = Path(__file__).parent / "json_schemas"


def _bank() -> dict[str, Any]:
    from bench.control.scenario import BankConfig

    schema, bank = scenario(), BankConfig.model_json_schema()
    schema["$defs"] |= bank.pop("$defs") | {"BankConfig": bank}
    schema["properties"] |= {"bank": {"$ref": "#/$defs/BankConfig"}}
    return schema


FORMATS = {
    form.name: form
    for form in (
        Format("bank", "A family of the bank of `python -m bench control`, as in bench/control/scenarios.", _bank),
        Format(
            "blind-scores-3",
            "`python -m bench blind score --json` and `blind pool --json`, format blind-scores/3.",
            "bench.blind.pooling:BlindScores",
        ),
        Format("bench-control-result", "`python -m bench control --json`.", "bench.control.result:BankResult"),
        Format("bench-trust-result", "`python -m bench trust --json`.", "bench.control.trust.result:TrustResult"),
        Format("bench-faults-result", "`python -m bench faults --json`.", "bench.faults.run:FaultBench"),
        Format("bench-judge-result", "`python -m bench judge --json`.", "bench.judge.command:JudgeResult"),
        Format("blind-run-result", "`python -m bench blind run --json`.", "bench.blind.command:SetDone"),
    )
}


def main() -> None:
    """Write every schema."""
    for name, form in FORMATS.items():
        write_json(FOLDER / f"{name}.json", form.schema())


if __name__ == "__main__":
    main()
