"""`--json`, the same for every command: which word is its file, where the result goes, and errors as JSON."""

import json
import sys
from collections.abc import Callable, Iterable, Sequence
from contextvars import ContextVar
from pathlib import Path
from typing import Annotated, Any, NoReturn

import typer
from typer.core import TyperGroup

from bridge.faults import Fault
from bridge.files import JSON, refuse_to_replace, strict_json, write_json
from bridge.plain import plain
from bridge.provenance import COMMAND
from cockpit.run.child_process import guarded, report
from cockpit.run.writable import check_output, writing

STDOUT = Path("-")
_OPTION = "--json"
_SUFFIX = ".json"
# the word after `--json`, which is an input where it does not end in .json
_AFTER: ContextVar[Sequence[str]] = ContextVar("after", default=())
# typer has click inside since 0.27 and beside it before; what it exports is of the same kind in both
_UsageError: type[Exception] = next(kind for kind in typer.BadParameter.__mro__ if kind.__name__ == "UsageError")

Json = Annotated[
    Path | None,
    typer.Option(
        _OPTION,
        metavar="[FILE.json]",
        help="Print the result as JSON on stdout, or write it to a file whose name ends in .json; words go to stdout then.",
    ),
]


class JsonGroup(TyperGroup):
    """A group of commands in which `--json` needs no value; with JSON on stdout a wrong command line is JSON as well."""

    def main(self, args: Sequence[str] | None = None, *more: Any, **options: Any) -> Any:
        """Run a command line, that of the process if none is given."""
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
            told = wrong.format_message().rstrip(".")
            line = f"{command}: {told}{_perhaps_meant(told)}; see {command} --help"
            status = guarded(lambda: report(Fault("CONFIG", line), as_json=True))
        sys.exit(status or 0)


def with_places(words: Sequence[str]) -> list[str]:
    """The command line with a place for every `--json`: the next word where that is `-` or ends in .json, else stdout."""
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
    """Do the work of a command and end with its exit status; a file for JSON that cannot be written is told before."""

    def checked() -> int | None:
        _check(as_json)
        try:
            return work()
        except Fault as fault:
            raise Fault(fault.kind.code, fault.line + _perhaps_meant(fault.line)) from None

    sys.exit(guarded(checked, as_json == STDOUT))


def _perhaps_meant(told: str) -> str:
    """What to add to an error about a word too many, or an input that is not there: that it may be meant as the file."""
    about = [word for word in _AFTER.get() if told.startswith(f"{word}: no ") or f"({word})" in told]
    return f"; if it is meant as the file of {_OPTION}, it must end in {_SUFFIX}" if about else ""


def tell(as_json: Path | None, result: Any, words: Iterable[str], indent: int | None = None) -> None:
    """Print a result, or write it and print its words. Raises Fault LOG_WRITE.

    Args:
        as_json: what `--json` says.
        result: named tuples, dictionaries, lists, numbers and texts.
        words: lines for a person.
        indent: of JSON on stdout; one line if not given.

    """
    if as_json == STDOUT:
        print(json.dumps(strict_json(result), allow_nan=False, indent=indent))
        return
    if as_json is not None:
        refuse_to_replace(as_json, JSON, f"{_OPTION} {as_json}")  # the command itself may have written its log there
        with writing(as_json):  # before anything is printed, which ends where nobody reads on
            write_json(as_json, result)
    for line in words:
        print(plain(line))


def _check(as_json: Path | None) -> None:
    """Raise Fault CONFIG or LOG_WRITE for what is no place for JSON."""
    if as_json is None or as_json == STDOUT:
        return
    if as_json.suffix.lower() != _SUFFIX:
        line = f"{_OPTION}={as_json}: must be - for stdout or end in {_SUFFIX}; choose another name"
        raise Fault("CONFIG", line)
    check_output(_OPTION, as_json, (_SUFFIX,))
