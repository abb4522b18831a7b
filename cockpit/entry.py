"""Entry point of the `stickslip` command. A stop by file is set before anything slow is imported."""

import atexit
import logging
import os
import sys
from typing import TYPE_CHECKING

from cockpit.first_stop import status_of_stop, stop_by_file

if TYPE_CHECKING:
    import typer


def main(app: "typer.Typer | None" = None) -> None:
    """Run the command line of `stickslip`, or of another `app`, and end the process."""
    if app is None:
        stop_by_file(sys.argv[1:])
        from cockpit.cli import app
    from cockpit.run.child_process import exit_status_of, prepare_stdout

    # joblib starts its workers with `python -m`, which would import a plant.py or numpy.py from the current folder first
    os.environ["PYTHONSAFEPATH"] = "1"
    # pictures are only written to files; matplotlib fails at import if the variable holds an unknown name
    os.environ["MPLBACKEND"] = "Agg"
    # One thread for linear algebra: to start the second takes 35 of the 90 ms of numpy's import on two cores, and two threads add
    # in another order than one. diagnosis/processes.py sets one thread for a diagnosis that is called from other programs.
    os.environ["OPENBLAS_NUM_THREADS"] = "1"
    os.environ["PYDANTIC_DISABLE_PLUGINS"] = "1"  # the search for plugins takes 10 ms, which would delay a stop
    # suppresses matplotlib's warning that it cannot store its font cache in a read-only home; the picture is the same
    logging.getLogger("matplotlib").setLevel(logging.ERROR)
    prepare_stdout()
    status = 1  # exit status after an exception that no command catches

    def end() -> None:
        sys.stdout.flush()
        os._exit(status)

    # Registered first, so it runs last, and ends the process before the interpreter is torn down. During the teardown an Arrow
    # thread that frees a table would abort the process, on a busy computer in one of seven commands that read a CSV.
    atexit.register(end)
    status = status_of_stop(sys.argv[1:], exit_status_of(lambda: _status(app)))
    sys.exit(status)


def _status(app: "typer.Typer") -> int:
    """Exit status of the command line; help and version end here too, so that a closed stdout is handled for them as well."""
    try:
        app()
    except SystemExit as end:
        return end.code if isinstance(end.code, int) else 0
    return 0
