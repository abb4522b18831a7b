"""`stickslip explain`: the meaning of a fault code, an exit status, an event, a verdict's finding or a word of a log."""

from difflib import get_close_matches
from typing import Annotated, NamedTuple

import typer

from bridge.faults import FAULTS, Fault
from bridge.wire.event_codes import EVENTS, SEVERITIES, EventCode
from bridge.wire.words import ColumnWord, words
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import command
from cockpit.judge.finding_codes import FINDINGS

# Least similarity of a suggestion, by `difflib`; FORCE_FROZEN and FROZEN have 0.67. Larger: fewer typing errors get a
# suggestion. Smaller: unrelated codes are suggested.
_ALIKE = 0.5
_NO_FAULTS = {
    0: "success; a completed diagnosis is a success, whatever its verdict",
    1: "the command completed, but the run, the log or the comparison failed; or, with a traceback, an error of the "
    "program: please report it",
    141: "the reader of the output closed it early, as `| head` does; the result of the command is unknown",
}


class Meaning(NamedTuple):
    """Meaning of an exit status, or of a fault with that exit status."""

    exit_status: int
    fault: str | None  # None: no fault has this status
    help: str

    def in_words(self) -> str:
        """A paragraph for the operator."""
        if self.fault is None:
            return f"exit status {self.exit_status}: {self.help}"
        return f"{self.fault} (exit status {self.exit_status})\n{self.help}"


Explained = list[Meaning | ColumnWord | EventCode]


def _kind(event: EventCode) -> str:
    return "finding" if event.code in FINDINGS else "event"


def _event_in_words(event: EventCode) -> str:
    severity = f"; {SEVERITIES[event.letter]}" if event.letter else ""
    return f"{_kind(event)}  {event.code:<14}  from the {event.sources}{severity}: {event.help}"


def _in_words(word: ColumnWord) -> str:
    return f"{word.column:<6} {word.number:>2}  {word.word:<14}  {word.help}"


def _codes(incomplete: str) -> list[str]:
    known = sorted({*FAULTS, *EVENTS, *FINDINGS, *(word.word for word in words())})
    return [code for code in known if code.startswith(incomplete.upper())]


@command()
def explain(
    code: Annotated[
        str,
        typer.Argument(
            help="For example ENDPOINT_BUSY, an exit status, EXCITER_END, GAP, or a column of a log: mode, state, reason, limit, "
            "event, finding; lists all if left out.",
            autocompletion=_codes,
        ),
    ] = "",
    as_json: Json = None,
) -> None:
    """Explain a fault code, exit status, event or finding and its remedy, or a mode, state, reason or limit in a log."""
    meanings = [Meaning(status, None, meaning) for status, meaning in _NO_FAULTS.items()]
    meanings += [Meaning(kind.exit_status, kind.code, kind.help) for kind in FAULTS.values()]
    logged, coded = words(), [*EVENTS.values(), *FINDINGS.values()]
    if not code:
        meanings.sort(key=lambda row: (row.exit_status, row.fault or ""))
        lines = [f"{row.exit_status:>3}  {row.fault or row.help}" for row in meanings]
        log_lines = [*map(_in_words, logged), "", *map(_event_in_words, coded)]
        print_result(as_json, [*meanings, *logged, *coded], [*lines, "", *log_lines])
        return
    wanted = [row for row in meanings if code.upper() in {row.fault, str(row.exit_status)}]
    of_a_log = [word for word in logged if code.upper() in {word.word, word.column.upper()}]
    events = [event for event in coded if code.upper() in {event.code, _kind(event).upper()}]
    if not (wanted or of_a_log or events):
        known = [
            *FAULTS,
            *(word.word for word in logged),
            *(word.column.upper() for word in logged),
            *EVENTS,
            *FINDINGS,
        ]
        near = get_close_matches(code.upper(), dict.fromkeys(known), 3, _ALIKE)
        meant = f"did you mean {' or '.join(near)}? " if near else ""
        line = f"{code}: not a fault code, exit status, event, finding or word of a log; {meant}`stickslip explain` lists all"
        raise Fault("CONFIG", line)
    paragraphs = ["\n\n".join(row.in_words() for row in wanted)] if wanted else []
    lines = [*paragraphs, *map(_in_words, of_a_log), *map(_event_in_words, events)]
    print_result(as_json, [*wanted, *of_a_log, *events], lines)
