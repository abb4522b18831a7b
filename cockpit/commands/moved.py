"""`stickslip bench` and `stickslip blind`, which left the package in 0.3."""

import shlex
from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json
from cockpit.commands.options import command


@command()
def moved(
    context: typer.Context,
    words: Annotated[list[str] | None, typer.Argument(hidden=True)] = None,
    as_json: Json = None,  # noqa: ARG001 (read by `command`)
) -> None:
    """Print the command that replaces this one, for a clone of the repository."""
    name = context.info_name
    made_by_tests = name == "blind" and (words or [])[:1] == ["make"]
    module = "python -m tests.blind" if made_by_tests else "python -m bench" + " blind" * (name == "blind")
    new = f"{module} {shlex.join(words or [])}".rstrip()
    raise Fault("CONFIG", f"stickslip {name}: moved out of the package; in a clone of the repository, run `{new}`")
