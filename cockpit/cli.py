"""The `stickslip` command, put together. Each command imports what it needs when it runs, so that `--help` is quick."""

import logging
import os

import typer

from cockpit.commands.blind import blind_app
from cockpit.commands.diagnose import diagnose
from cockpit.commands.explain import explain
from cockpit.commands.log import log_app
from cockpit.commands.pictures import plot, reproduce, stability
from cockpit.commands.processes import controller, operator_stop, plant, record
from cockpit.commands.replay import replay_command
from cockpit.commands.run import run
from cockpit.commands.scenarios import scenarios

app = typer.Typer(
    help="Real-time control against stick-slip: run a rig or its stand-in, replay, recover and judge its logs.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)
app.command("run")(run)
app.command("plant")(plant)
app.command("controller")(controller)
app.command("record")(record)
app.command("recorder", hidden=True)(record)  # a child is named by its role
app.command("stop")(operator_stop)
app.command("replay")(replay_command)
app.command("plot")(plot)
app.command("map")(stability)
app.command("diagnose")(diagnose)
app.add_typer(log_app, name="log")
app.add_typer(blind_app, name="blind")
app.command("reproduce")(reproduce)
app.command("scenarios")(scenarios)
app.command("explain")(explain)


def main() -> None:
    """Entry point of the `stickslip` command."""
    # for joblib, which starts its workers with `python -m`: the folder of the person who calls would be searched first, and
    # may hold a plant.py or numpy.py of that person's own
    os.environ["PYTHONSAFEPATH"] = "1"
    # a picture looks the same where a read-only home keeps no cache of its fonts, of which matplotlib warns in two lines
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    app()
