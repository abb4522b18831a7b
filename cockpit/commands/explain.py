"""`stickslip explain`: what a fault code, an exit status, an event or a word of the controller means."""

from difflib import get_close_matches
from typing import Annotated, NamedTuple

import typer

from bridge.faults import FAULTS, Fault
from bridge.wire.event_codes import EVENTS, LETTERS, EventCode
from bridge.wire.words import Word, words
from cockpit.commands.as_json.option import Json, carry_out, tell

_ALIKE = 0.5  # as `difflib` has it: FORCE_FROZEN is as near to FROZEN as 0.67
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


def _event_in_words(one: EventCode) -> str:
    """A line for a person."""
    letter = f" [{one.letter}, {LETTERS[one.letter].partition(':')[0]}]" if one.letter else ""
    return f"event  {one.code:<14}  from the {one.sources}{letter}: {one.help}"


def _in_words(one: Word) -> str:
    """A line for a person."""
    return f"{one.column:<6} {one.number:>2}  {one.word:<14}  {one.help}"


def explain(
    code: Annotated[
        str,
        typer.Argument(
            help="For example ENDPOINT_BUSY, an exit status, PIEZO_WEAK, GAP, or a column of a log: mode, state, reason, limit, "
            "event; all of them if left out."
        ),
    ] = "",
    as_json: Json = None,
) -> None:
    """Say what a fault code, exit status or event means and what to do, or a mode, state, reason or limit in a log."""

    def work() -> None:
        meanings = [Meaning(status, None, said) for status, said in _NO_FAULTS.items()]
        meanings += [Meaning(kind.exit_status, kind.code, kind.help) for kind in FAULTS.values()]
        logged = words()
        if not code:
            meanings.sort(key=lambda one: (one.exit_status, one.fault or ""))
            lines = [f"{one.exit_status:>3}  {one.fault or one.help}" for one in meanings]
            told = [*map(_in_words, logged), "", *map(_event_in_words, EVENTS.values())]
            tell(as_json, [*meanings, *logged, *EVENTS.values()], [*lines, "", *told])
            return
        wanted = [one for one in meanings if code.upper() in {one.fault, str(one.exit_status)}]
        of_a_log = [one for one in logged if code.upper() in {one.word, one.column.upper()}]
        events = [one for one in EVENTS.values() if code.upper() in {one.code, "EVENT"}]
        if not (wanted or of_a_log or events):
            known = [*FAULTS, *(one.word for one in logged), *(one.column.upper() for one in logged), *EVENTS]
            near = get_close_matches(code.upper(), dict.fromkeys(known), 3, _ALIKE)
            meant = f"did you mean {' or '.join(near)}? " if near else ""
            line = (
                f"{code}: is no fault code, exit status, event or word of a log; {meant}`stickslip explain` lists all"
            )
            raise Fault("CONFIG", line)
        paragraphs = ["\n\n".join(one.in_words() for one in wanted)] if wanted else []
        lines = [*paragraphs, *map(_in_words, of_a_log), *map(_event_in_words, events)]
        tell(as_json, [*wanted, *of_a_log, *events], lines)

    carry_out(work, as_json)
