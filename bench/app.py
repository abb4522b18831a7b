"""The command line of `python -m bench`."""

import typer

from bench.blind.command import blind_app
from bench.control.command import control
from bench.control.trust.command import trust
from bench.faults.command import faults
from bench.judge.command import judge
from cockpit.commands.as_json.option import JsonGroup

app = typer.Typer(
    cls=JsonGroup,
    help="How good are controller, guard and diagnosis? Judged by the truth of simulated rigs, compared with simple rivals.",
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)
app.command("control")(control)
app.command("trust")(trust)
app.command("faults")(faults)
app.command("judge")(judge)
app.add_typer(blind_app, name="blind")
