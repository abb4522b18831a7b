"""The `stickslip` command, put together. Each command imports what it needs when it runs, so that `--help` is quick."""

import platform
from typing import Annotated

import typer

from cockpit.commands.as_json.option import JsonGroup
from cockpit.commands.blind import blind_app
from cockpit.commands.certs import certs
from cockpit.commands.diagnose import diagnose
from cockpit.commands.example import example
from cockpit.commands.explain import explain
from cockpit.commands.live import serve, watch
from cockpit.commands.log import log_app
from cockpit.commands.look import look
from cockpit.commands.person import add_words
from cockpit.commands.pictures import plot, reproduce, review, stability
from cockpit.commands.processes import controller, plant, record
from cockpit.commands.replay import replay_command
from cockpit.commands.run import run
from cockpit.commands.scenarios import scenarios
from cockpit.commands.schema import schema
from cockpit.commands.stress.bench import bench_app
from cockpit.commands.stress.fault import fault
from cockpit.commands.stress.soak import soak

app = typer.Typer(
    cls=JsonGroup,
    help="Real-time control against stick-slip: run a rig or its stand-in, replay, recover and judge its logs.",
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


def _examples(*lines: str) -> str:
    """For the end of a help text."""
    return "\n".join(["Examples:", *(f"  {line}" for line in lines)])


app.command(
    "run",
    epilog=_examples(
        "stickslip run",
        "stickslip run --in-process --set controller.limits.v_ratio=1.3",
        "stickslip run --scenario stop-and-go --log runs/axis.mcap",
        "stickslip run --scenario belt-axis --set duration_s=0          until Ctrl-C",
        "stickslip run --lockstep --json > verdict.json",
    ),
)(run)
app.command("plant")(plant)
app.command("controller")(controller)
app.command("record")(record)
app.command("recorder", hidden=True)(record)  # a child is named by its role
add_words(app)
app.command(
    "serve",
    epilog=_examples(
        "stickslip serve                           then open http://127.0.0.1:8447/",
        "stickslip serve --port 9000 --endpoint tcp/127.0.0.1:7448",
    ),
)(serve)
app.command(
    "watch",
    epilog=_examples("stickslip watch", "stickslip watch --json --every 0.5 | jq .velocity_ratio"),
)(watch)
app.command(
    "fault",
    epilog=_examples(
        "stickslip fault --list", "stickslip fault base-accel-half --for 5", "stickslip fault controller-frozen-2-s"
    ),
)(fault)
app.command("soak", epilog=_examples("stickslip soak --hours 1 --report soak.md", "stickslip soak --minutes 3"))(soak)
app.command(
    "certs",
    epilog=_examples(
        "stickslip certs ~/.config/stickslip/certificates --host rig.lab",
        "stickslip run --endpoint tls/127.0.0.1:7447",
    ),
)(certs)
app.command(
    "replay",
    epilog=_examples(
        "stickslip replay runs/paper-c45-c45.mcap",
        "stickslip replay runs/paper-c45-c45.mcap --set limits.v_ratio=1.3@10s",
        "stickslip replay runs/paper-c45-c45.mcap --closed-loop --set limits.v_ratio=1.3",
        "stickslip replay runs/paper-c45-c45.mcap --to-bus --all --speed 2",
    ),
)(replay_command)
app.command(
    "plot",
    epilog=_examples(
        "stickslip plot runs/paper-c45-c45.mcap",
        "stickslip plot runs/paper-c45-c45.mcap --out figure.pdf --style paper --from 7s --to 10s --data figure.csv",
        "stickslip plot runs/a.mcap --vs runs/b.mcap --signals drive_force_N,amplitude_m --out both.svg",
    ),
)(plot)
app.command(
    "review",
    epilog=_examples(
        "stickslip review runs/paper-c45-c45.mcap",
        "stickslip review runs/before.mcap runs/after.mcap --out compared.html",
    ),
)(review)
app.command("map")(stability)
app.command(
    "diagnose",
    epilog=_examples(
        "stickslip diagnose runs/example --report report.html",
        "stickslip diagnose runs/example --json",
        "stickslip diagnose runs/example --json diagnosis.json --apply rig.toml",
        "stickslip diagnose evidence/ --jobs 2 --report reports",
    ),
)(diagnose)
app.command(
    "look",
    epilog=_examples(
        "stickslip look tribometer.csv",
        "stickslip look tribometer.csv --speed 0.5mm/s --load 94.5N --out look.html --out slips.xlsx",
        "stickslip look tribometer.csv --out map.toml",
    ),
)(look)
app.command("example", epilog=_examples("stickslip example runs/example", "stickslip diagnose runs/example"))(example)
app.add_typer(
    log_app,
    name="log",
    epilog=_examples(
        "stickslip log info runs/paper-c45-c45.mcap",
        "stickslip log export runs/paper-c45-c45.mcap --to run.csv --topic sensors --until 2s",
        "stickslip log import measured.csv --map map.toml --out evidence/rig",
    ),
)
app.add_typer(blind_app, name="blind")
app.add_typer(
    bench_app,
    name="bench",
    epilog=_examples("stickslip bench control --small", "stickslip bench control --jobs 2 --report control.html"),
)
app.command("reproduce")(reproduce)
app.command("scenarios")(scenarios)
app.command("schema")(schema)
app.command("explain")(explain)


def _say_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"stickslip {version('stickslip')}, Python {platform.python_version()}")
        raise typer.Exit


@app.callback()
def about(
    _version: Annotated[
        bool, typer.Option("--version", callback=_say_version, is_eager=True, help="Say the version and leave.")
    ] = False,
) -> None:
    """Take what stands before the name of a command."""
