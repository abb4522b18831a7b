"""While kernels are compiled: the number of kernels left, on stderr, and the guard of a command, which a signal ends at once."""

import sys
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from bridge.plain import say

PROGRESS = "compiling kernels, once for this version: "  # and then `12 of 163 left`
_LINES = 8  # where stderr is no terminal, for all kernels
_BAR = 20  # characters
# of a command: a signal ends it at once in here; elsewhere signals act as ever
guard: Callable[[], AbstractContextManager[None]] = nullcontext


class Progress:
    """One line on a terminal that is written again and again, and some lines elsewhere."""

    def __init__(self) -> None:
        self._on_terminal = sys.stderr is not None and sys.stderr.isatty()  # pyright: ignore[reportUnnecessaryComparison]
        self._step = -1  # the last one that was shown

    def show(self, left: int, total: int) -> None:
        """Show how many kernels are left; with none left the line is over."""
        step = (total if self._on_terminal else _LINES) * (total - left) // max(total, 1)
        if step == self._step or (not left and self._step < 0):
            return
        self._step = step if left else -1
        words = f"{PROGRESS}{left} of {total} left"
        if self._on_terminal:
            bar = "#" * (_BAR * (total - left) // max(total, 1))
            print(f"\r{words:<70}[{bar:<{_BAR}}]", end="" if left else "\n", file=sys.stderr, flush=True)
        else:
            say(f"stickslip: {words}")


def left_in(line: str) -> tuple[int, int] | None:
    """How many kernels are left, of how many, in a line of a child's stderr; None in a line about something else."""
    words = line.removeprefix("stickslip: ")
    if not words.startswith(PROGRESS):
        return None
    left, _, total = words.removeprefix(PROGRESS).partition(" of ")
    return int(left), int(total.split()[0])


class _Work:
    """The kernels that this process has to compile now."""

    def __init__(self) -> None:
        self.depth = 0
        self.module = ""
        self.total: set[object] = set()
        self.done: set[object] = set()
        self.progress: Progress | None = None

    def show(self, left: int) -> None:
        if self.progress is None:
            self.progress = Progress()
        self.progress.show(left, len(self.total))


_work = _Work()


def expect(kernels: set[object]) -> None:
    """Count these kernels as not yet compiled."""
    _work.total |= kernels


def note_done(kernels: set[object]) -> None:
    """These kernels are compiled, or were loaded."""
    _work.done |= kernels
    if kernels & _work.total:
        _work.show(max(len(_work.total - _work.done), 1))  # the last one still waits for its machine code


@contextmanager
def compiling(module: str = "") -> Generator[str]:
    """Kernels are compiled or loaded in here, which the command guards; the progress is over at the end.

    Args:
        module: of these kernels, where it is known; a nested call gets it.

    """
    _work.depth += 1
    _work.module = _work.module or module
    try:
        with guard() if _work.depth == 1 else nullcontext():
            yield _work.module
    finally:
        _work.depth -= 1
        if not _work.depth:
            _work.module = ""
            if _work.progress is not None:
                _work.show(0)
            _work.total, _work.progress = set(), None
