"""Options that several commands share, and the progress bar of slow commands."""

import json
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from functools import wraps
from inspect import Parameter, Signature, signature
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple, NoReturn, get_type_hints

import typer

from cockpit.commands.as_json.option import carry_out

if TYPE_CHECKING:
    from bridge.wire.zenoh_link import BusConfig
    from cockpit.look.source import LookOptions


def scenario_names(incomplete: str) -> list[str]:
    """Scenarios whose names begin with `incomplete`, for the completion of a shell."""
    from cockpit.run.scenario_file import deploy_folder

    return [path.stem for path in sorted(deploy_folder().glob(f"scenarios/{incomplete}*.toml"))]


DEFAULT_SCENARIO = "paper-c45-c45"
Certs = Annotated[
    Path | None,
    typer.Option(
        "--certs",
        metavar="FOLDER",
        help="Folder made by `stickslip certs`, for a tls/ address; ~/.config/stickslip/certificates if not given.",
    ),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print all figures, warnings and findings.")]
Strict = Annotated[
    bool,
    typer.Option("--strict", help="For acceptance tests: exit status 1 also for any lost message or late command."),
]


class SharedOptions(NamedTuple):
    """Values of the options that several commands share."""

    scenario: Annotated[
        str,
        typer.Option(
            metavar="NAME",
            help="Name of a scenario (`stickslip scenarios` lists them), or a .toml file.",
            autocompletion=scenario_names,
        ),
    ] = DEFAULT_SCENARIO
    settings: Annotated[
        list[str],
        typer.Option(
            "--set",
            metavar="KEY=VALUE",
            help="Change one value of the scenario, e.g. controller.limits.v_ratio=1.3. Repeatable.",
        ),
    ] = []
    seed: Annotated[
        int | None, typer.Option(metavar="NUMBER", help="Seed of the sensor noise; the same seed gives the same run.")
    ] = None
    endpoint: Annotated[
        str | None,
        typer.Option(
            metavar="ADDRESS", help="Address of the bus, e.g. tcp/127.0.0.1:7447; the scenario's if not given."
        ),
    ] = None
    prefix: Annotated[str | None, typer.Option(metavar="WORD", help="First part of every key on the bus.")] = None
    certs: Certs = None
    insecure: Annotated[
        bool,
        typer.Option("--insecure", help="Accept unauthenticated clients at a tcp/ address that other computers reach."),
    ] = False
    lockstep: Annotated[
        bool,
        typer.Option("--lockstep", help="Not in real time: each block waits for its command. Repeatable to the bit."),
    ] = False
    log: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Log to write; runs/NAME.mcap if not given; `soak`: temporary.")
    ] = None
    wait: Annotated[
        float | None,
        typer.Option(
            min=0.1, max=1e6, metavar="S", help="Longest wait for the other processes at the start, in seconds."
        ),
    ] = None
    child: Annotated[int, typer.Option(hidden=True)] = 0  # process id of the parent; 0: started by an operator

    def as_settings(self) -> list[str]:
        """The options as `key=value` settings of a scenario."""
        values = {
            "seed": self.seed,
            "bus.endpoint": self.endpoint,
            "bus.prefix": self.prefix,
            "bus.certificates": self.certs and str(self.certs.absolute()),
            "bus.insecure": self.insecure or None,
            "bus.wait_s": self.wait,
        }
        given = [f"{key}={json.dumps(value, ensure_ascii=False)}" for key, value in values.items() if value is not None]
        return [*self.settings, *given]

    def bus(self) -> "BusConfig":
        """The bus of the scenario. Raises Fault CONFIG."""
        from cockpit.run.scenario_file import load_bus

        return load_bus(self.scenario, self.as_settings())


BUS = ("scenario", "endpoint", "prefix", "certs")  # options that choose the bus of a running rig


class FileOptions(NamedTuple):
    """Options of the commands that read a measured file."""

    speed: Annotated[str, typer.Option(help="Drive speed, e.g. 0.5mm/s; for stiffness and mass.")] = ""
    load: Annotated[str, typer.Option(help="Normal load, e.g. 94.5N; for friction coefficients.")] = ""
    mass: Annotated[str, typer.Option(help="Known mass of the slide, e.g. 1.5kg; compared with the estimate.")] = ""
    rate: Annotated[str, typer.Option(help="Sampling rate, e.g. 1kHz; replaces a time column.")] = ""
    time: Annotated[str, typer.Option(help='Time column; with its unit if it states none: "T [ms]".')] = ""
    force: Annotated[
        str,
        typer.Option(
            help="Force column or formula: '1.2e-3 * (pA - pB)'; or a motor current, torque or following error."
        ),
    ] = ""
    position: Annotated[str, typer.Option(help="Column of the drive's position.")] = ""
    piece: Annotated[
        int | None, typer.Option(min=1, help="One piece of a file whose time begins again; all if not given.")
    ] = None
    encoding: Annotated[str, typer.Option(help="Encoding of a text, e.g. cp1250, if it is not recognised.")] = ""
    channel_map: Annotated[
        Path | None, typer.Option("--map", help="Channel map, .toml: columns, units, scales, rig.")
    ] = None

    def asked(self) -> "LookOptions":
        """The options in SI units. Raises Fault CONFIG."""
        from cockpit.look.quantity import quantity, turns
        from cockpit.look.source import LookOptions

        return LookOptions(
            quantity("--speed", self.speed, "velocity"),
            quantity("--load", self.load, "force"),
            quantity("--mass", self.mass, "mass"),
            quantity("--rate", self.rate, "frequency"),
            self.time,
            self.force,
            self.channel_map,
            turns(self.speed) if self.speed else None,
            self.position,
            self.piece,
            self.encoding or None,
        )


FILE = FileOptions._fields


def command(*names: str, **defaults: Any) -> Callable[[Callable[..., int | None]], Callable[..., NoReturn]]:
    """Make a command of a function with the option `as_json`; it ends with the exit status that the function returns.

    Args:
        names: fields of `SharedOptions`, or all of `FileOptions`; the function receives their values as its first argument.
        defaults: fields with another default value.

    """
    group: Any = FileOptions if names == FILE else SharedOptions
    kinds, values = get_type_hints(group, include_extras=True), group._field_defaults | defaults
    options = [
        Parameter(name, Parameter.KEYWORD_ONLY, default=values[name], annotation=kinds[name])
        for name in (*defaults, *names)
    ]

    def decorated(function: Callable[..., int | None]) -> Callable[..., NoReturn]:
        @wraps(function)
        def called(**given: Any) -> NoReturn:
            shared = {option.name: given.pop(option.name) for option in options}
            first = [group(**shared)] if options else []
            carry_out(lambda: function(*first, **given), given["as_json"])

        parameters = list(signature(function).parameters.values())[bool(options) :]
        made: Any = called
        made.__signature__ = Signature([*options, *(row.replace(kind=Parameter.KEYWORD_ONLY) for row in parameters)])
        return made

    return decorated


@contextmanager
def watched_share(text: str, quiet: bool) -> Generator[Callable[[float], None]]:
    """Show a progress bar on stderr if it is a terminal; yields the function to call with the share done."""
    if quiet or not sys.stderr.isatty():
        yield lambda _share: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=1.0)
        yield lambda share: bar.update(task, completed=share)
