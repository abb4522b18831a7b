"""Compilation of kernels: progress on stderr, and a context in which a signal ends the command at once."""

import signal
import sys
from collections.abc import Callable, Generator
from contextlib import AbstractContextManager, contextmanager, nullcontext

from bridge.plain import print_line

PROGRESS = "compiling kernels, once for this version: "  # followed by `12 of 163 left`
_LINES = 8  # progress lines for all kernels together, if stderr is not a terminal
_BAR = 20  # length of the progress bar [characters]
# Set by a command: a context in which a signal ends the process at once. Without it signals wait for the end of a compilation.
guard: Callable[[], AbstractContextManager[None]] = nullcontext


class Progress:
    """Shows progress: one line that is rewritten, on a terminal; a few lines elsewhere."""

    def __init__(self) -> None:
        self._on_terminal = sys.stderr is not None and sys.stderr.isatty()  # pyright: ignore[reportUnnecessaryComparison]
        self._step = -1  # the step shown last; -1 before the first line and after the last line
        # kernels left then; a module that loads others adds to them, and a rising count would look like a fault
        self._left = 0

    def show(self, left: int, total: int) -> None:
        """Show how many kernels are left; 0 ends the line."""
        step = (total if self._on_terminal else _LINES) * (total - left) // max(total, 1)
        if step == self._step or (left > self._left if self._step >= 0 else not left):
            return
        self._step, self._left = step if left else -1, left
        words = f"{PROGRESS}{left} of {total} left"
        if self._on_terminal:
            bar = "#" * (_BAR * (total - left) // max(total, 1))
            print(f"\r{words:<70}[{bar:<{_BAR}}]", end="" if left else "\n", file=sys.stderr, flush=True)
        else:
            print_line(f"stickslip: {words}")


def left_in(line: str) -> tuple[int, int] | None:
    """Kernels left and kernels in all, from a line of a child's stderr; None for any other line."""
    words = line.removeprefix("stickslip: ")
    if not words.startswith(PROGRESS):
        return None
    left, _, total = words.removeprefix(PROGRESS).partition(" of ")
    return int(left), int(total.split()[0])


class _Work:
    """The kernels that this process compiles at present."""

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
    """Add kernels to the ones whose compilation the progress counts."""
    _work.total |= kernels


def note_done(kernels: set[object]) -> None:
    """Count these kernels as compiled or loaded."""
    _work.done |= kernels
    if kernels & _work.total:
        _work.show(max(len(_work.total - _work.done), 1))  # the last kernel still waits for its machine code


@contextmanager
def _alarm_held() -> Generator[None]:
    """A body after which SIGALRM, the end of a time budget, arrives: an exception within a compilation leaves half a kernel."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGALRM})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


@contextmanager
def compiling(module: str = "") -> Generator[str]:
    """Guard the compilation or loading of kernels and show its progress; yields the module of the outermost context.

    Args:
        module: the module of these kernels, if known.

    """
    _work.depth += 1
    _work.module = _work.module or module
    try:
        with guard() if _work.depth == 1 else nullcontext(), _alarm_held():
            yield _work.module
    finally:
        _work.depth -= 1
        if not _work.depth:
            _work.module = ""
            if _work.progress is not None:
                _work.show(0)
            _work.total, _work.progress = set(), None
