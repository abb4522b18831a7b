"""While kernels are compiled: how many are left, on stderr, and what a command guards that time with."""

import sys
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from bridge.plain import say

PROGRESS = "compiling kernels, once for this version: "  # and then `12 of 163 left`
_LINES = 8  # where stderr is no terminal, for all kernels
_BAR = 20  # characters
# of a command, which ends at once where a signal comes in here; elsewhere signals act as ever
guard: Callable[[], AbstractContextManager[None]] = nullcontext


class Progress:
    """One line on a terminal that is written again and again, and some lines elsewhere."""

    def __init__(self) -> None:
        self._on_terminal = sys.stderr is not None and sys.stderr.isatty()  # pyright: ignore[reportUnnecessaryComparison]
        self._shown = ""
        self._part = -1

    def show(self, left: int, total: int) -> None:
        """Show how many kernels are left; with none left the line is over."""
        part = _LINES * (total - left) // max(total, 1)
        words = f"{PROGRESS}{left} of {total} left"
        if self._on_terminal:
            bar = "#" * (_BAR * (total - left) // max(total, 1))
            line = f"\r{words:<70}[{bar:<{_BAR}}]"
            if line != self._shown and (left or self._shown):
                self._shown = line if left else ""
                print(line, end="" if left else "\n", file=sys.stderr, flush=True)
        elif part != self._part and (left or self._part >= 0):
            self._part = part if left else -1
            say(f"stickslip: {words}")


def left_in(line: str) -> tuple[int, int] | None:
    """How many kernels are left, of how many, in a line of a child's stderr; None in a line about something else."""
    words = line.removeprefix("stickslip: ")
    if not words.startswith(PROGRESS):
        return None
    left, _, total = words.removeprefix(PROGRESS).partition(" of ")
    return int(left), int(total.split()[0])


class _Work:
    """What this process has to compile now."""

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
    """Count these as what is to be compiled."""
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
        module: whose kernels these are, where that is known; it is given back to whoever comes inside.

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
