"""`stickslip scenarios`: the scenarios and rigs that come with the project."""

from pathlib import Path
from typing import Annotated, NamedTuple

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import command, scenario_names


class Shipped(NamedTuple):
    """The shipped scenarios and rigs."""

    scenarios: dict[str, str]  # name and description
    rigs: list[str]


class Copied(NamedTuple):
    """The copy of a scenario."""

    file: str


ScenariosResult = Shipped | Copied


@command()
def scenarios(
    copy: Annotated[
        str,
        typer.Option(
            "--copy",
            metavar="NAME",
            help="Copy this scenario to NAME.toml in the current folder, as a start for a new one.",
            autocompletion=scenario_names,
        ),
    ] = "",
    as_json: Json = None,
) -> None:
    """List the scenarios and rigs that come with the project, or copy one scenario."""
    from bridge.config import read_toml
    from bridge.files import write_whole
    from cockpit.run.scenario_file import deploy_folder, find
    from cockpit.run.writable import RIG, check_output, writing

    if copy:
        source, target = find(copy, "scenarios"), Path(f"{Path(copy).stem}.toml")
        if target.exists():
            raise Fault("CONFIG", f"--copy {copy}: {target} exists and is not replaced; rename or delete it first")
        check_output("--copy", target, RIG)
        lines = source.read_text(encoding="utf-8").splitlines(keepends=True)
        with writing(target):  # the line `#:schema` is left out: its path is relative to the folder of the source
            write_whole(target, "".join(line for line in lines if not line.startswith("#:schema")))
        print_result(as_json, Copied(str(target)), [str(target), f"next     stickslip run --scenario {target}"])
        return
    known = {
        path.stem: str(read_toml(path).get("description", ""))
        for path in sorted(deploy_folder().glob("scenarios/*.toml"))
    }
    rigs = [path.stem for path in sorted(deploy_folder().glob("rigs/*.toml"))]
    words = [f"{name:<24} {description}" for name, description in known.items()]
    print_result(as_json, Shipped(known, rigs), [*words, f"rigs: {', '.join(rigs)}"])
