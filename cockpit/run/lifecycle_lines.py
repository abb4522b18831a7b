"""Lines on the terminal of a process that was started alone; the process never waits for the terminal."""

import queue
import threading
from collections.abc import Generator
from contextlib import contextmanager

from bridge.plain import LOADED, StepReport, print_line

_LAST_LINES_S = 1.0  # wait at the end for lines that are not yet printed


@contextmanager
def step_reports(quiet: bool) -> Generator[StepReport]:
    """A function that prints a line on stderr, e.g. `waiting  for a rig`, in a thread: Ctrl-S must not stall a control loop.

    Args:
        quiet: print only once, at the first line, that everything is loaded, as a child of `stickslip run` does.

    """
    if quiet:
        yield _once_loaded()
        return
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def print_lines() -> None:
        while (line := lines.get()) is not None:
            print_line(line)

    # Started before the process claims its priority for all its threads, this one too: the loop may wait for its Python lock.
    thread = threading.Thread(target=print_lines, name="step lines", daemon=True)
    thread.start()
    try:
        yield lambda label, text: lines.put(f"{label:<8} {text}")
    finally:
        lines.put(None)
        thread.join(_LAST_LINES_S)


def _once_loaded() -> StepReport:
    is_printed = False

    def print_once(_label: str, _text: str) -> None:
        nonlocal is_printed
        if not is_printed:
            is_printed = True
            print_line(f"stickslip: {LOADED}")

    return print_once
