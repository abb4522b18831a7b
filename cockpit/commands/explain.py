"""`stickslip explain`: what a fault code or an exit status means."""

import sys
from typing import Annotated

import typer

from bridge.faults import FAULTS
from cockpit.run.child_process import guarded

_NO_FAULTS = {
    "0": "all is well; a diagnosis that was made is, whatever it says",
    "1": "the command did its work, and the run, the log or the comparison is not as it should be; or, with a traceback, "
    "an error of the program: please report it",
    "141": "whoever read the output closed it before its end, as `| head` does; what the command would have ended with is not "
    "known",
}


def explain(
    code: Annotated[
        str, typer.Argument(help="For example ENDPOINT_BUSY, or an exit status; all of them if left out.")
    ] = "",
) -> None:
    """Say what a fault code or an exit status means and what to do."""

    def work() -> int:
        if not code:
            rows = [(kind.exit_status, kind.code) for kind in FAULTS.values()]
            for status, meaning in sorted((*rows, *((int(status), said) for status, said in _NO_FAULTS.items()))):
                print(f"{status:>3}  {meaning}")
            return 0
        if code in _NO_FAULTS:
            print(f"exit status {code}: {_NO_FAULTS[code]}")
            return 0
        kinds = [kind for kind in FAULTS.values() if code.upper() in {kind.code, str(kind.exit_status)}]
        if not kinds:
            statuses = ", ".join(sorted({*_NO_FAULTS, *(str(kind.exit_status) for kind in FAULTS.values())}, key=int))
            print(f"stickslip: {code}: unknown; known: {', '.join(FAULTS)}; exit statuses {statuses}", file=sys.stderr)
            return 2
        print("\n\n".join(f"{kind.code} (exit status {kind.exit_status})\n{kind.help}" for kind in kinds))
        return 0

    sys.exit(guarded(work))
