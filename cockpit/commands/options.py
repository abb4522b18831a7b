"""Options that several commands have, as typer wants them; a bar for those that take a while."""

import json
import sys
from collections.abc import Callable, Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated

import typer

ScenarioName = Annotated[
    str, typer.Option("--scenario", help="Name of a scenario in deploy/scenarios, or a .toml file.")
]
Settings = Annotated[
    list[str],
    typer.Option("--set", help="Change one value: key=value, e.g. controller.limits.v_ratio=1.3. Repeatable."),
]
Seed = Annotated[int | None, typer.Option(help="Seed of the sensor noise; the same seed gives the same run.")]
Endpoint = Annotated[str | None, typer.Option(help="Where the processes meet, e.g. tcp/127.0.0.1:7447.")]
Certs = Annotated[
    Path | None,
    typer.Option(
        "--certs", help="Folder that `stickslip certs` made, for tls/; ~/.config/stickslip/certificates if not given."
    ),
]
Insecure = Annotated[
    bool, typer.Option("--insecure", help="Listen at a tcp/ endpoint that others reach, and ask nobody for a password.")
]
Wait = Annotated[
    float | None,
    typer.Option("--wait", min=0.1, max=1e6, metavar="S", help="Longest wait for the others at the start, in seconds."),
]
Verbose = Annotated[bool, typer.Option("--verbose", "-v", help="All figures, warnings and findings.")]
Strict = Annotated[
    bool, typer.Option("--strict", help="For acceptance tests: any lost message or late command is exit status 1, too.")
]
Prefix = Annotated[str | None, typer.Option(help="First part of every key on the bus.")]
Lockstep = Annotated[
    bool,
    typer.Option("--lockstep", help="Not paced: each block waits for its command. Repeatable to the bit."),
]
ChildOf = Annotated[int, typer.Option("--child", hidden=True)]  # the process that started this one, 0: a person
LogFile = Annotated[Path | None, typer.Option("--log", help="Where the log goes; runs/NAME.mcap if not given.")]
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
    """What the options say, as settings of a scenario."""
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
    """A bar on stderr for a person who watches; yields the function to call with the share done."""
    if quiet or not sys.stderr.isatty():
        yield lambda _share: None
        return
    from rich.console import Console
    from rich.progress import Progress

    with Progress(console=Console(stderr=True), transient=True) as bar:
        task = bar.add_task(text, total=1.0)
        yield lambda share: bar.update(task, completed=share)
