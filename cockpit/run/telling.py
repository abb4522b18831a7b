"""What a process that a person started alone says on its terminal, without ever waiting for the terminal."""

import queue
import threading
from collections.abc import Generator
from contextlib import contextmanager

from bridge.plain import LOADED, Tell, say

_LAST_WORDS_S = 1.0  # for what is still to be printed at the end


@contextmanager
def telling(quiet: bool) -> Generator[Tell]:
    """A function that prints a line on stderr, `waiting  for a rig`, in a thread: Ctrl-S on the terminal must not hold up a loop.

    Args:
        quiet: say only at the first line that all is loaded, as a child of `stickslip run`, which has a line of its own.

    """
    if quiet:
        yield _once_loaded()
        return
    lines: queue.SimpleQueue[str | None] = queue.SimpleQueue()

    def print_them() -> None:
        while (line := lines.get()) is not None:
            say(line)

    # before the process claims its priority, which is then that of this thread, too: it may hold Python's lock
    thread = threading.Thread(target=print_them, name="telling", daemon=True)
    thread.start()
    try:
        yield lambda what, text: lines.put(f"{what:<8} {text}")
    finally:
        lines.put(None)
        thread.join(_LAST_WORDS_S)


def _once_loaded() -> Tell:
    told = False

    def tell(_what: str, _text: str) -> None:
        nonlocal told
        if not told:
            told = True
            say(f"stickslip: {LOADED}")

    return tell
