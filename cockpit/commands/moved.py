"""`stickslip bench` and `stickslip blind`, which left the package in 0.3."""

import shlex
from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import Json, carry_out


def moved(
    context: typer.Context, words: Annotated[list[str] | None, typer.Argument(hidden=True)] = None, as_json: Json = None
) -> None:
    """Print the command that replaces this one, for a clone of the repository."""

    def work() -> None:
        name = context.info_name
        new = " ".join(["python -m bench", *(["blind"] if name == "blind" else []), shlex.join(words or [])]).rstrip()
        raise Fault("CONFIG", f"stickslip {name}: moved out of the package; in a clone of the repository, run `{new}`")

    carry_out(work, as_json)
