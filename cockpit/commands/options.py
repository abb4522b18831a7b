"""Options that several commands share, and the progress bar of slow commands."""

import json
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer


def scenario_names(incomplete: str) -> list[str]:
    """Scenarios whose names begin with `incomplete`, for the completion of a shell."""
    from cockpit.run.scenario_file import deploy_folder

    return [path.stem for path in sorted(deploy_folder().glob(f"scenarios/{incomplete}*.toml"))]


ScenarioName = Annotated[
    str,
    typer.Option(
        "--scenario",
        metavar="NAME",
        help="Name of a scenario (`stickslip scenarios` lists them), or a .toml file.",
        autocompletion=scenario_names,
    ),
]
Settings = Annotated[
    list[str],
    typer.Option(
        "--set",
        metavar="KEY=VALUE",
        help="Change one value of the scenario, e.g. controller.limits.v_ratio=1.3. Repeatable.",
    ),
]
Seed = Annotated[
    int | None, typer.Option(metavar="NUMBER", help="Seed of the sensor noise; the same seed gives the same run.")
]
Endpoint = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Address of the bus, e.g. tcp/127.0.0.1:7447; the scenario's if not given."),
]
Certs = Annotated[
    Path | None,
    typer.Option(
        "--certs",
        metavar="FOLDER",
        help="Folder made by `stickslip certs`, for a tls/ address; ~/.config/stickslip/certificates if not given.",
    ),
]
Insecure = Annotated[
    bool,
    typer.Option("--insecure", help="Accept unauthenticated clients at a tcp/ address that other computers reach."),
]
Wait = Annotated[
    float | None,
    typer.Option(
        "--wait", min=0.1, max=1e6, metavar="S", help="Longest wait for the other processes at the start, in seconds."
    ),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="Print all figures, warnings and findings.")]
Strict = Annotated[
    bool,
    typer.Option("--strict", help="For acceptance tests: exit status 1 also for any lost message or late command."),
]
Prefix = Annotated[str | None, typer.Option(metavar="WORD", help="First part of every key on the bus.")]
Lockstep = Annotated[
    bool,
    typer.Option("--lockstep", help="Not in real time: each block waits for its command. Repeatable to the bit."),
]
ChildOf = Annotated[int, typer.Option("--child", hidden=True)]  # process id of the parent; 0: started by an operator
LogFile = Annotated[
    Path | None, typer.Option("--log", metavar="FILE", help="Log to write; runs/NAME.mcap if not given.")
]
DEFAULT_SCENARIO = "paper-c45-c45"


def as_settings(
    settings: list[str],
    seed: int | None,
    endpoint: str | None,
    prefix: str | None,
    certs: Path | None = None,
    insecure: bool = False,
    wait_s: float | None = None,
) -> list[str]:
    """The options as `key=value` settings of a scenario."""
    result = list(settings)
    if seed is not None:
        result.append(f"seed={seed}")
    if endpoint is not None:
        result.append(f'bus.endpoint="{endpoint}"')
    if prefix is not None:
        result.append(f'bus.prefix="{prefix}"')
    if certs is not None:
        result.append(f"bus.certificates={json.dumps(str(certs.absolute()), ensure_ascii=False)}")
    if insecure:
        result.append("bus.insecure=true")
    if wait_s is not None:
        result.append(f"bus.wait_s={wait_s}")
    return result


@contextmanager
def watched_share(text: str, quiet: bool) -> Generator[Callable[[float], None]]:
    """A progress bar on stderr if it is a terminal; yields the function to call with the share done."""
    if quiet or not sys.stderr.isatty():
        yield lambda _share: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=1.0)
        yield lambda share: bar.update(task, completed=share)
