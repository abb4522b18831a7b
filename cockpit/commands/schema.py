"""`stickslip schema`: the JSON Schema of every TOML and JSON format, for editors and for programs that read results."""

import json
from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from bridge.faults import Fault
from bridge.files import write_json
from cockpit.commands.as_json.option import Json, carry_out, tell
from cockpit.run.writable import check_output_folder, writing


class Named(NamedTuple):
    """A schema that there is."""

    name: str
    about: str


def schema(
    name: Annotated[
        str, typer.Argument(help="For example rig or diagnosis-2; a list of all of them if left out.")
    ] = "",
    out: Annotated[
        Path | None, typer.Option(metavar="FOLDER", help="Write NAME.json there, or all of them if no NAME is given.")
    ] = None,
    as_json: Json = None,
) -> None:
    """Print the JSON Schema of a file or of a result of --json. A TOML file names its own by `#:schema PATH` in line 1."""

    def work() -> None:
        from cockpit.commands.as_json.schemas import FORMATS

        key = name.replace("/", "-")
        if key and key not in FORMATS:
            raise Fault("CONFIG", f"{name}: no such schema; known: {', '.join(FORMATS)}")
        wanted = [FORMATS[key]] if key else list(FORMATS.values())
        if out is not None:
            check_output_folder("--out", out)
            with writing(out):
                for one in wanted:
                    write_json(out / f"{one.name}.json", one.schema())
        names = [Named(one.name, one.about) for one in wanted]
        if out is not None:
            tell(as_json, names, [f"written  {out / one.name}.json" for one in names])
        elif not key:
            tell(as_json, names, [f"{one.name:<20} {one.about}" for one in names])
        else:
            made = FORMATS[key].schema()
            tell(as_json, made, [json.dumps(made, indent=1)], indent=1)

    carry_out(work, as_json)
