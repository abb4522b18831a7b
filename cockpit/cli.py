"""The `stickslip` command, put together. A command is loaded when it is called, so that each waits for itself alone."""

import platform
from collections import UserDict
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.main import get_group

from cockpit.commands.as_json.option import JsonGroup

# by name: module and object of the command in cockpit.commands, and examples for the end of its help text
_COMMANDS: dict[str, tuple[str, ...]] = {
    "run": (
        "run.run",
        "stickslip run",
        "stickslip run --in-process --set controller.limits.v_ratio=1.3",
        "stickslip run --scenario stop-and-go --log runs/axis.mcap",
        "stickslip run --scenario belt-axis --set duration_s=0          until Ctrl-C",
        "stickslip run --lockstep --json > verdict.json",
    ),
    "plant": ("processes.plant",),
    "controller": ("processes.controller",),
    "record": ("processes.record",),
    "recorder": ("processes.record",),
    "arm": ("person.arm",),
    "disarm": ("person.disarm",),
    "stop": ("person.stop",),
    "reset": ("person.reset",),
    "status": ("person.status",),
    "serve": (
        "live.serve",
        "stickslip serve                           then open http://127.0.0.1:8447/",
        "stickslip serve --port 9000 --endpoint tcp/127.0.0.1:7448",
    ),
    "watch": ("live.watch", "stickslip watch", "stickslip watch --json --every 0.5 | jq .velocity_ratio"),
    "fault": (
        "stress.fault.fault",
        "stickslip fault --list",
        "stickslip fault base-accel-half --for 5",
        "stickslip fault controller-frozen-2-s",
    ),
    "soak": ("stress.soak.soak", "stickslip soak --hours 1 --report soak.md", "stickslip soak --minutes 3"),
    "certs": (
        "certs.certs",
        "stickslip certs ~/.config/stickslip/certificates --host rig.lab",
        "stickslip run --endpoint tls/127.0.0.1:7447",
    ),
    "replay": (
        "replay.replay_command",
        "stickslip replay runs/paper-c45-c45.mcap",
        "stickslip replay runs/paper-c45-c45.mcap --set limits.v_ratio=1.3@10s",
        "stickslip replay runs/paper-c45-c45.mcap --closed-loop --set limits.v_ratio=1.3",
        "stickslip replay runs/paper-c45-c45.mcap --to-bus --all --speed 2",
    ),
    "plot": (
        "pictures.plot",
        "stickslip plot runs/paper-c45-c45.mcap",
        "stickslip plot runs/paper-c45-c45.mcap --out figure.pdf --style paper --from 7s --to 10s --data figure.csv",
        "stickslip plot runs/a.mcap --vs runs/b.mcap --signals drive_force_N,amplitude_m --out both.svg",
    ),
    "review": (
        "pictures.review",
        "stickslip review runs/paper-c45-c45.mcap",
        "stickslip review runs/before.mcap runs/after.mcap --out compared.html",
    ),
    "map": ("pictures.stability",),
    "diagnose": (
        "diagnose.diagnose",
        "stickslip diagnose runs/example --report report.html",
        "stickslip diagnose runs/example --json",
        "stickslip diagnose runs/example --json diagnosis.json --apply rig.toml",
        "stickslip diagnose evidence/ --jobs 2 --report reports",
    ),
    "look": (
        "look.look",
        "stickslip look tribometer.csv",
        "stickslip look tribometer.csv --speed 0.5mm/s --load 94.5N --out look.html --out slips.xlsx",
        "stickslip look tribometer.csv --out map.toml",
    ),
    "example": ("example.example", "stickslip example runs/example", "stickslip diagnose runs/example"),
    "log": (
        "log.log_app",
        "stickslip log info runs/paper-c45-c45.mcap",
        "stickslip log export runs/paper-c45-c45.mcap --to run.csv --topic sensors --until 2s",
        "stickslip log import measured.csv --map map.toml --out evidence/rig",
    ),
    "blind": ("blind.blind_app",),
    "bench": (
        "stress.bench.bench_app",
        "stickslip bench control --small",
        "stickslip bench control --jobs 2 --report control.html",
    ),
    "reproduce": ("pictures.reproduce",),
    "scenarios": ("scenarios.scenarios",),
    "schema": ("schema.schema",),
    "explain": ("explain.explain",),
}
_HIDDEN = "recorder"  # a child is named by its role


class _Commands(UserDict[str, Any]):
    """Every command by its name; its place until it is asked for."""

    def __getitem__(self, key: str) -> Any:
        found = super().__getitem__(key)
        if isinstance(found, tuple):
            place, *examples = found
            module, _, own = place.rpartition(".")
            found = getattr(import_module(f"cockpit.commands.{module}"), own)
            epilog = "\n".join(["Examples:", *(f"  {line}" for line in examples)]) if examples else None
            alone = typer.Typer(pretty_exceptions_enable=False)
            if isinstance(found, typer.Typer):
                alone.add_typer(found, name=key, epilog=epilog)
            else:
                alone.command(key, epilog=epilog, hidden=key == _HIDDEN)(found)
            self[key] = found = get_group(alone).commands[key]
        return found


class _Root(JsonGroup):
    """The group of every command."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = _Commands(_COMMANDS)


app = typer.Typer(
    cls=_Root,
    help="Real-time control against stick-slip: run a rig or its stand-in, replay, recover and judge its logs.",
    context_settings={"help_option_names": ["-h", "--help"]},
    no_args_is_help=True,
    pretty_exceptions_enable=False,
)


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
