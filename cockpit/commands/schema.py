"""`stickslip schema`: the JSON Schema of every TOML and JSON format, for editors and for programs that read results."""

import json
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from bridge.faults import Fault
from bridge.results import write_json
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import command
from cockpit.run.writable import check_output_folder, writing


class SchemaName(NamedTuple):
    """A row of the list of schemas."""

    name: str
    about: str


SchemaNames = list[SchemaName]


@command()
def schema(
    name: Annotated[str, typer.Argument(help="For example rig or diagnosis-2; lists all schemas if left out.")] = "",
    out: Annotated[
        Path | None,
        typer.Option(metavar="FOLDER", help="Write NAME.json to this folder, or all schemas if NAME is left out."),
    ] = None,
    as_json: Json = None,
) -> None:
    """Print the JSON Schema of a TOML file or a --json result. A TOML file names its schema in line 1: `#:schema PATH`."""
    from cockpit.commands.as_json.schemas import FORMATS

    key = name.replace("/", "-")
    if key and key not in FORMATS:
        raise Fault("CONFIG", f"{name}: no such schema; known: {', '.join(FORMATS)}")
    wanted = [FORMATS[key]] if key else list(FORMATS.values())
    if out is not None:
        check_output_folder("--out", out)
        with writing(out):
            for kind in wanted:
                write_json(out / f"{kind.name}.json", kind.schema())
    names = [SchemaName(kind.name, kind.about) for kind in wanted]
    if out is not None:
        print_result(as_json, names, [f"written  {out / row.name}.json" for row in names])
    elif not key:
        print_result(as_json, names, [f"{row.name:<20} {row.about}" for row in names])
    else:
        made = FORMATS[key].schema()
        print_result(as_json, made, [json.dumps(made, indent=1)], indent=1)
