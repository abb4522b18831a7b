"""Where the `stickslip` command begins."""

import atexit
import logging
import os
import sys

from cockpit.cli import app
from cockpit.run.child_process import guarded, prepare_stdout


def main() -> None:
    """Entry point of the `stickslip` command."""
    # for joblib, which starts its workers with `python -m`: the folder of the person who calls would be searched first, and
    # may hold a plant.py or numpy.py of that person's own
    os.environ["PYTHONSAFEPATH"] = "1"
    os.environ["MPLBACKEND"] = (
        "Agg"  # pictures are files; matplotlib refuses to start where the variable names none it knows
    )
    # Of the 90 ms that numpy's import takes on two cores, 35 start the second thread of linear algebra, and two threads add in
    # another order than one. diagnosis/processes.py gives a diagnosis one thread wherever it is called from.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "1"  # to look for some takes 10 ms, of which a stop has none to spare
    # a picture looks the same where a read-only home keeps no cache of its fonts, of which matplotlib warns in two lines
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    prepare_stdout()
    status = 1  # of an exception that no command catches

    def end() -> None:
        sys.stdout.flush()
        os._exit(status)

    # The first function that is registered runs last, and the interpreter is not dismantled: a thread of Arrow that frees a
    # table's bytes after that began aborts the process. Both cores busy, 7 of 48 commands that read a CSV ended by SIGABRT.
    atexit.register(end)
    status = guarded(_status)
    sys.exit(status)


def _status() -> int:
    """Exit status of the command line; help and version are guarded as results are."""
    try:
        app()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    return 0
