"""The option `--json` of every command: its file name, the output of the result, and faults as JSON."""

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from bridge.faults import Fault
from bridge.files import JSON, refuse_to_replace
from bridge.plain import plain
from bridge.provenance import COMMAND
from bridge.results import strict_json, write_json
from cockpit.first_stop import CUT_AMPLIFIER
from cockpit.run.child_process import exit_status_of, report
from cockpit.run.writable import check_output, writing

STDOUT = Path("-")
_OPTION = "--json"
_SUFFIX = ".json"
# the word after `--json` on the command line, for a hint: unless it ends in .json it is an input of the command
_AFTER: ContextVar[Sequence[str]] = ContextVar("after", default=())
# typer contains click since 0.27 and depended on it before; BadParameter has the same base classes in both
_UsageError: type[Exception] = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "UsageError")

Json = Annotated[
    Path | None,
    typer.Option(
        _OPTION,
        metavar="[FILE.json]",
        help="Print the result as JSON on stdout, or write it to a file that ends in .json and print text on stdout.",
    ),
]


class JsonGroup(TyperGroup):
    """A group of commands in which `--json` needs no value; with JSON on stdout a usage error is JSON as well."""

    def main(self, args: Sequence[str] | None = None, *more: Any, **options: Any) -> Any:
        """Run a command line; `sys.argv` if none is given."""
        given = list(sys.argv[1:] if args is None else args)
        words = with_places(given)
        COMMAND.set(given)
        _AFTER.set(given[given.index(_OPTION) + 1 : given.index(_OPTION) + 2] if _OPTION in given else [])
        if f"{_OPTION}={STDOUT}" not in words:
            return super().main(words, *more, **options)
        try:
            status = super().main(words, *more, **options | {"standalone_mode": False})
        except _UsageError as error:
            wrong: Any = error
            command = wrong.ctx.command_path if wrong.ctx else "stickslip"
            message = wrong.format_message().rstrip(".")
            line = f"{command}: {message}{_perhaps_meant(message)}; see {command} --help"
            fault = Fault("CONFIG", line)
            if given[:1] == ["stop"]:  # its status, as of each stop that was not sent
                fault = Fault("NO_PEER", f"{line}; STOP NOT DELIVERED: {CUT_AMPLIFIER}")
            status = exit_status_of(lambda: report(fault, as_json=True))
        sys.exit(status or 0)


def with_places(words: Sequence[str]) -> list[str]:
    """Give every `--json` of a command line a value: the next word if it is `-` or ends in .json, else stdout."""
    result: list[str] = []
    left = list(words)
    while left:
        word = left.pop(0)
        if word == "--":
            return [*result, word, *left]
        if word == _OPTION:
            named = bool(left) and (left[0] == str(STDOUT) or left[0].lower().endswith(_SUFFIX))
            word = f"{_OPTION}={left.pop(0) if named else STDOUT}"
        result.append(word)
    return result


def carry_out(work: Callable[[], int | None], as_json: Path | None) -> NoReturn:
    """Do the work of a command and end with its exit status; a JSON file that cannot be written is refused before the work."""

    def checked() -> int | None:
        _check(as_json)
        try:
            return work()
        except Fault as fault:
            raise Fault(fault.kind.code, fault.line + _perhaps_meant(fault.line)) from None

    sys.exit(exit_status_of(checked, as_json == STDOUT))


def _perhaps_meant(message: str) -> str:
    """Hint for an error about a superfluous word or a missing input: the word may be meant as the JSON file."""
    about = [word for word in _AFTER.get() if message.startswith(f"{word}: no ") or f"({word})" in message]
    return f"; if it is meant as the file of {_OPTION}, it must end in {_SUFFIX}" if about else ""


def print_result(as_json: Path | None, result: Any, words: Iterable[str], indent: int | None = None) -> None:
    """Print a result as JSON, or print its lines and write the JSON to a file. Raises Fault LOG_WRITE.

    `result` consists of named tuples, dictionaries, lists, numbers and texts; `words` are lines for the operator; `indent` is the
    indentation of JSON on stdout, which is one line without it.
    """
    if as_json == STDOUT:
        print(json.dumps(strict_json(result), allow_nan=False, indent=indent))
        return
    try:
        for line in words:
            print(plain(line))
    finally:  # written also if a reader closes stdout, which ends the command
        if as_json is not None:
            refuse_to_replace(
                as_json, JSON, f"{_OPTION} {as_json}"
            )  # the command itself may have written its log there
            with writing(as_json):
                write_json(as_json, result)


def _check(as_json: Path | None) -> None:
    """Raise Fault CONFIG or LOG_WRITE for a path that cannot hold JSON."""
    if as_json is None or as_json == STDOUT:
        return
    if as_json.suffix.lower() != _SUFFIX:
        line = f"{_OPTION}={as_json}: must be - for stdout or end in {_SUFFIX}; choose another name"
        raise Fault("CONFIG", line)
    if as_json.name.endswith(".verdict.json"):
        raise Fault("CONFIG", f"{_OPTION}={as_json}: is named like the verdict of a log; choose another name")
    check_output(_OPTION, as_json, (_SUFFIX,))
