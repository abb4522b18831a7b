"""The `stickslip` command line. A command's module is imported when the command is called, which keeps the others fast."""

import platform
from collections import UserDict
from importlib import import_module
from typing import Annotated, Any

import typer
from typer.main import get_group

from cockpit.commands.as_json.option import JsonGroup

# by help panel and command name: module and function in cockpit.commands, then the examples at the end of the help text
_PANELS: dict[str, dict[str, tuple[str, ...]]] = {
    "Try it": {
        "run": (
            "processes.run",
            "stickslip run",
            "stickslip run --in-process --set controller.limits.v_ratio=1.3",
            "stickslip run --scenario stop-and-go --log runs/axis.mcap",
            "stickslip run --scenario belt-axis --set duration_s=0          until Ctrl-C",
            "stickslip run --lockstep --json > verdict.json",
        ),
        "scenarios": ("scenarios.scenarios",),
        "example": (
            "example.example",
            "stickslip example runs/example",
            "stickslip diagnose runs/example",
        ),
        "explain": ("explain.explain",),
        "reproduce": ("pictures.reproduce",),
    },
    "My axis": {
        "look": (
            "look.look",
            "stickslip look tribometer.csv",
            "stickslip look tribometer.csv --speed 0.5mm/s --load 94.5N --out look.html --out slips.xlsx",
            "stickslip look tribometer.csv --out map.toml",
        ),
        "diagnose": (
            "diagnose.diagnose",
            "stickslip diagnose runs/example --report report.html",
            "stickslip diagnose runs/example --json",
            "stickslip diagnose runs/example --json diagnosis.json --apply rig.toml",
            "stickslip diagnose evidence/ --jobs 2 --report reports",
        ),
        "map": ("pictures.stability",),
    },
    "Rig": {
        "plant": ("processes.plant",),
        "rig": (
            "rig.rig_app",
            "stickslip rig check mine.toml",
            "stickslip rig conformance mine.toml --junit report.xml",
            "stickslip rig serve mine.toml",
            "stickslip rig box box.toml",
        ),
        "controller": ("processes.controller",),
        "record": ("processes.record",),
        "arm": ("operator_commands.arm",),
        "disarm": ("operator_commands.disarm",),
        "stop": ("operator_commands.stop",),
        "reset": ("operator_commands.reset",),
        "status": ("operator_commands.status",),
        "watch": (
            "live.watch",
            "stickslip watch",
            "stickslip watch --json --every 0.5 | jq .velocity_ratio",
        ),
        "serve": (
            "live.serve",
            "stickslip serve                           then open http://127.0.0.1:8447/",
            "stickslip serve --port 9000 --endpoint tcp/127.0.0.1:7448",
        ),
        "certs": (
            "certs.certs",
            "stickslip certs ~/.config/stickslip/certificates --host rig.lab",
            "stickslip run --endpoint tls/127.0.0.1:7447",
        ),
    },
    "Logs": {
        "log": (
            "log.log_app",
            "stickslip log info runs/paper-c45-c45.mcap",
            "stickslip log export runs/paper-c45-c45.mcap --to run.csv --topic sensors --until 2s",
            "stickslip log import measured.csv --map map.toml --out evidence/rig",
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
        "replay": (
            "replay.replay_command",
            "stickslip replay runs/paper-c45-c45.mcap",
            "stickslip replay runs/paper-c45-c45.mcap --set limits.v_ratio=1.3@10s",
            "stickslip replay runs/paper-c45-c45.mcap --closed-loop --set limits.v_ratio=1.3",
            "stickslip replay runs/paper-c45-c45.mcap --to-bus --all --speed 2",
        ),
    },
    "Proof": {
        "test": (
            "testing.run_tests",
            "stickslip test",
            "stickslip test tests/ --jobs 4 --junit results.xml",
            "stickslip test limits.toml --log runs/old.mcap",
            "stickslip test --mutants",
            "stickslip test --rig my-axis.toml --arm",
        ),
        "fmu": (
            "fmu.fmu",
            "stickslip fmu paper-c45-c45 --out rig.fmu",
            "stickslip fmu belt-axis --set slide.mass_kg=2.0 --fmi 2 --out heavy.fmu",
            "stickslip fmu paper-c45-c45 --controller --out controller.fmu",
        ),
        "fault": (
            "proof.fault",
            "stickslip fault --list",
            "stickslip fault base-accel-half --for 5",
            "stickslip fault controller-frozen-2-s",
        ),
        "soak": (
            "proof.soak",
            "stickslip soak --hours 1 --report soak.md",
            "stickslip soak --minutes 3",
        ),
        "schema": ("proof.schema",),
    },
}
_MOVED = {"blind": ("moved.moved",), "bench": ("moved.moved",)}
_HIDDEN = {"recorder": ("processes.record",)} | _MOVED  # `stickslip run` starts each child by the name of its role
_PANEL_OF = {name: panel for panel, commands in _PANELS.items() for name in commands}
_BEGIN = """\
stickslip run              simulate a rig, first without and then with the controller, and judge the run
stickslip look FILE        estimate slips, friction and stiffness from a measured file
stickslip diagnose FOLDER  find the effect that makes a rig differ from its model
stickslip --help           all commands"""


def _name_types(command: Any) -> None:
    """Show the types of options as words in the help: `FILE` rather than `<path>`."""
    for option in command.params:
        kind = option.type.name
        if option.param_type_name == "option" and not option.is_flag and option.metavar is None and kind != "choice":
            option.metavar = "FILE" if kind == "path" else "NUMBER" if kind.startswith(("int", "float")) else "WORD"


class _Commands(UserDict[str, Any]):
    """Commands by name. A value is the row of `_PANELS` until the command is first looked up."""

    def __getitem__(self, key: str) -> Any:
        entry = super().__getitem__(key)
        if isinstance(entry, tuple):
            place, *examples = entry
            module, _, function = place.rpartition(".")
            entry = getattr(import_module(f"cockpit.commands.{module}"), function)
            epilog = "\n".join(["Examples:", *(f"  {line}" for line in examples)]) if examples else None
            alone = typer.Typer(pretty_exceptions_enable=False)
            if isinstance(entry, typer.Typer):
                alone.add_typer(entry, name=key, epilog=epilog, rich_help_panel=_PANEL_OF[key])
            else:
                any_words = {"ignore_unknown_options": True} if key in _MOVED else None
                panel = _PANEL_OF.get(key)
                alone.command(
                    key, epilog=epilog, hidden=key in _HIDDEN, context_settings=any_words, rich_help_panel=panel
                )(entry)
            self[key] = entry = get_group(alone).commands[key]
            for command in getattr(entry, "commands", {key: entry}).values():
                _name_types(command)
        return entry


class _Root(JsonGroup):
    """The group of every command."""

    def __init__(self, **options: Any) -> None:
        super().__init__(**options)
        self.commands = _Commands({name: row for rows in (*_PANELS.values(), _HIDDEN) for name, row in rows.items()})


app = typer.Typer(
    cls=_Root,
    help="Real-time control against stick-slip: run a real or simulated rig, judge and replay its logs, diagnose it.",
    context_settings={"help_option_names": ["-h", "--help"]},
    invoke_without_command=True,
    pretty_exceptions_enable=False,
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from importlib.metadata import version

        print(f"stickslip {version('stickslip')}, Python {platform.python_version()}")
        raise typer.Exit


@app.callback()
def about(
    context: typer.Context,
    _version: Annotated[
        bool, typer.Option("--version", callback=_print_version, is_eager=True, help="Print the version and exit.")
    ] = False,
) -> None:
    """Print the first commands to try if no command is given."""
    if context.invoked_subcommand is None:
        print(_BEGIN)
        raise typer.Exit(2)
