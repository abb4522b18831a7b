"""The first act of `stickslip stop`: it stops a rig of this computer by file, before anything slow is imported."""

import contextlib
import os
import tomllib
from pathlib import Path
from typing import Any

from bridge.faults import FAULTS
from bridge.guard import stop_file
from bridge.plain import print_line

_WITH_VALUE = ("--endpoint", "--scenario", "--prefix", "--certs")
BY_FILE_S = 1.0  # longest wait for a confirmation by file; a rig needs 10 ms and its ramp
_NO_PEER = FAULTS["NO_PEER"].exit_status
_DEFAULT = "tcp/127.0.0.1:7447"  # endpoint of a scenario that names none

ordered: list[stop_file.StopOrder] = []  # the stops that this process ordered at its start
answers: list[Any] = []  # the answer of the rig to the stop of this process
CUT_AMPLIFIER = "assume that the exciter still vibrates: cut its amplifier by hand now"


def stop_by_file(words: list[str]) -> None:
    """Order the stop of a command line `stop ...`; one with an unknown option, or another command, orders none."""
    if words[:1] == ["stop"] and (given := _options(words[1:])) is not None and (endpoint := _endpoint(given)):
        ordered.extend(stop_file.order(endpoint, sender()))


def status_of_stop(words: list[str], status: int) -> int:
    """The exit status of a command line: a stop that failed before it was sent, as by a wrong option, ends like NO_PEER."""
    if words[:1] != ["stop"] or answers or status in (0, _NO_PEER) or stop_file.confirmed(ordered, BY_FILE_S):
        return status
    print_line(f"stickslip: STOP NOT DELIVERED: {CUT_AMPLIFIER}")
    return _NO_PEER


def sender() -> str:
    """The sender of an operator command, for the log of the rig."""
    return f"{os.environ.get('USER') or 'unknown user'} (process {os.getpid()})"


def _options(words: list[str]) -> dict[str, str] | None:
    """The values of the options; None if one is unknown: the command then ends with a message and does nothing."""
    given: dict[str, str] = {}
    left = list(words)
    while left:
        name, equals, value = left.pop(0).partition("=")
        if name in _WITH_VALUE:
            if not (equals or left):
                return None
            given[name] = value if equals else left.pop(0)
        elif name == "--json":
            if left and (left[0] == "-" or left[0].lower().endswith(".json")):
                left.pop(0)
        else:
            return None
    return given


def _endpoint(given: dict[str, str]) -> str:
    """The endpoint of the rig; empty if the scenario cannot be read, which the command then reports."""
    if "--endpoint" in given or "--scenario" not in given:
        return given.get("--endpoint", _DEFAULT)
    path = Path(given["--scenario"])
    if path.suffix != ".toml":
        below = [Path(__file__).parent, Path(__file__).parents[1]]  # as cockpit.run.scenario_file.deploy_folder
        path = next(
            (file for folder in below if (file := folder / "deploy" / "scenarios" / f"{path}.toml").is_file()), path
        )
    with contextlib.suppress(OSError, ValueError):
        bus: Any = tomllib.loads(path.read_text(encoding="utf-8")).get("bus", {})
        return str(bus.get("endpoint", _DEFAULT)) if isinstance(bus, dict) else ""
    return ""
