"""`stickslip explain`: what a fault code or an exit status means."""

from typing import Annotated, NamedTuple

import typer

from bridge.faults import FAULTS, Fault
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


def explain(
    code: Annotated[
        str, typer.Argument(help="For example ENDPOINT_BUSY, or an exit status; all of them if left out.")
    ] = "",
    as_json: Json = None,
) -> None:
    """Say what a fault code or an exit status means and what to do."""

    def work() -> None:
        meanings = [Meaning(status, None, said) for status, said in _NO_FAULTS.items()]
        meanings += [Meaning(kind.exit_status, kind.code, kind.help) for kind in FAULTS.values()]
        if not code:
            meanings.sort(key=lambda one: (one.exit_status, one.fault or ""))
            tell(as_json, meanings, [f"{one.exit_status:>3}  {one.fault or one.help}" for one in meanings])
            return
        wanted = [one for one in meanings if code.upper() in {one.fault, str(one.exit_status)}]
        if not wanted:
            statuses = ", ".join(map(str, sorted({one.exit_status for one in meanings})))
            line = f"{code}: is no fault code and no exit status; known: {', '.join(FAULTS)}; exit statuses {statuses}"
            raise Fault("CONFIG", line)
        tell(as_json, wanted, ["\n\n".join(one.in_words() for one in wanted)])

    carry_out(work, as_json)
