"""`stickslip explain`: what a fault code, an exit status or a word of the controller means."""

from typing import Annotated, NamedTuple

import typer

from bridge.faults import FAULTS, Fault
from bridge.wire.words import Word, words
from cockpit.commands.json_option import Json, carry_out, tell

_NO_FAULTS = {
    0: "all is well; a diagnosis that was made is, whatever it says",
    1: "the command did its work, and the run, the log or the comparison is not as it should be; or, with a traceback, "
    "an error of the program: please report it",
    141: "whoever read the output closed it before its end, as `| head` does; what the command would have ended with is not "
    "known",
}


class Meaning(NamedTuple):
    """Of an exit status, or of the fault that ends with it."""

    exit_status: int
    fault: str | None  # None: no fault ends with it
    help: str

    def in_words(self) -> str:
        """A paragraph for a person."""
        if self.fault is None:
            return f"exit status {self.exit_status}: {self.help}"
        return f"{self.fault} (exit status {self.exit_status})\n{self.help}"


def _in_words(one: Word) -> str:
    """A line for a person."""
    return f"{one.column:<6} {one.number:>2}  {one.word:<14}  {one.help}"


def explain(
    code: Annotated[
        str,
        typer.Argument(
            help="For example ENDPOINT_BUSY, an exit status, PIEZO_WEAK, or a column of a log: mode, state, reason, limit; "
            "all of them if left out."
        ),
    ] = "",
    as_json: Json = None,
) -> None:
    """Say what a fault code or an exit status means and what to do, or what a mode, state, reason or limit in a log means."""

    def work() -> None:
        meanings = [Meaning(status, None, said) for status, said in _NO_FAULTS.items()]
        meanings += [Meaning(kind.exit_status, kind.code, kind.help) for kind in FAULTS.values()]
        logged = words()
        if not code:
            meanings.sort(key=lambda one: (one.exit_status, one.fault or ""))
            lines = [f"{one.exit_status:>3}  {one.fault or one.help}" for one in meanings]
            tell(as_json, [*meanings, *logged], [*lines, "", *map(_in_words, logged)])
            return
        wanted = [one for one in meanings if code.upper() in {one.fault, str(one.exit_status)}]
        of_a_log = [one for one in logged if code.upper() in {one.word, one.column.upper()}]
        if not wanted and not of_a_log:
            statuses = ", ".join(map(str, sorted({one.exit_status for one in meanings})))
            line = f"{code}: is no fault code, exit status or word of a log; known: {', '.join(FAULTS)}; exit statuses {statuses}"
            columns = ", ".join(dict.fromkeys(one.column for one in logged))
            raise Fault("CONFIG", f"{line}; columns of a log {columns}")
        paragraphs = ["\n\n".join(one.in_words() for one in wanted)] if wanted else []
        tell(as_json, [*wanted, *of_a_log], [*paragraphs, *map(_in_words, of_a_log)])

    carry_out(work, as_json)
