"""Where the `stickslip` command begins: a person's word to a rig loads no other command."""

import logging
import os
import sys

import typer

from cockpit.commands.as_json.option import JsonGroup
from cockpit.commands.person import WORDS, add_words
from cockpit.run.child_process import guarded, prepare_stdout


def main() -> None:
    """Entry point of the `stickslip` command."""
    # for joblib, which starts its workers with `python -m`: the folder of the person who calls would be searched first, and
    # may hold a plant.py or numpy.py of that person's own
    os.environ["PYTHONSAFEPATH"] = "1"
    os.environ["MPLBACKEND"] = (
        "Agg"  # pictures are files; matplotlib refuses to start where the variable names none it knows
    )
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "1"  # to look for some takes 10 ms, of which a stop has none to spare
    # a picture looks the same where a read-only home keeps no cache of its fonts, of which matplotlib warns in two lines
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    prepare_stdout()
    sys.exit(guarded(_status))


def _status() -> int:
    """Exit status of the command line; help and version are guarded as results are."""
    try:
        _app()()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    return 0


def _app() -> typer.Typer:
    """The words alone where the first word is one of them, else every command."""
    if sys.argv[1:2] and sys.argv[1] in WORDS:
        words = typer.Typer(
            cls=JsonGroup,
            context_settings={"help_option_names": ["-h", "--help"]},
            pretty_exceptions_enable=False,
        )
        add_words(words)
        return words
    from cockpit.cli import app

    return app
