"""The thread of a rig that writes and watches its state files: a slow disk delays no block and no fade."""

import contextlib
import threading
from collections.abc import Callable, Generator
from functools import partial

from bridge.faults import Fault
from bridge.guard.kept import StateFile, StopLatch
from bridge.guard.stop_file import RigFile
from bridge.threads import repeat

# Interval at which the latch is looked at. Longer: a stop by file begins later. Shorter: 30 us of the Python lock for each look.
_LOOK_S = 0.01
# Looks at the latch for each look at the rig's file. More: after its removal a stop by file is refused for longer. Fewer: on a
# full disk more attempts to make it.
_LOOKS = 100
_NOT_KEPT = "the order does not outlast a restart"
_LAST_WRITES_S = 2.0  # longest wait at the end of a rig for a slow disk


class Keeper:
    """Writes the newest state of each kind, finds a stop by file, and confirms it once the rig is at rest.

    A stop holds while its file exists. The rig's loop compares `holder` with its guard and sets `at_rest` for each block; the
    thread does all work on files.

    Args:
        latch: the operator's stop.
        rig: the file in which stops are confirmed.

    """

    def __init__(self, latch: StopLatch, rig: RigFile) -> None:
        self.latch = latch
        self.at_rest = False  # whether a stop holds the rig without vibration
        self.problem = ""  # why the rig takes no stop by file
        self.rig = rig
        self._run = 0
        self._report: Callable[[str], object] = print
        self._orders = 0  # number of stops and resets over the bus
        self._seen_ns = 0  # time of the stop in the latch, at the last look
        self._sender: str | None = None  # its sender; None without a stop, and after a reset that could not remove it
        # number of orders that were carried out before the last look, and the sender that it saw
        self._found: tuple[int, str | None] = 0, None
        self._confirmed_ns = 0
        self._waiting: dict[StateFile, tuple[Callable[[], None], str]] = {}
        self._looks = 0
        self._over = threading.Event()

    @contextlib.contextmanager
    def running(self, run: int, report: Callable[[str], object]) -> Generator[None]:
        """Keep states and find stops in the body. A `problem` at its start is not reported.

        Args:
            run: number of the rig's run.
            report: reports a state that could not be kept, as text.

        """
        self._run, self._report = run, report
        if not self.latch.outlasts:
            with contextlib.suppress(OSError):
                self.latch.clear()
            self._seen_ns = self.latch.set_ns  # a stop of an earlier run that could not be removed does not hold
        self.problem = self._make_rig_file()
        self._look()
        thread = threading.Thread(target=self._work, name="keep", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._over.set()
            thread.join(_LAST_WRITES_S)
            if not self.latch.outlasts:  # else its file stays, so that a stop is kept while it starts again
                with contextlib.suppress(OSError):
                    self.rig.remove()
                    self.latch.clear()

    def keep(self, state: StateFile, write: Callable[[], None], lost: str) -> None:
        """Call `write` soon, in place of an earlier one of this state that still waits; a failure loses `lost`."""
        self._waiting[state] = write, lost

    def keep_stop(self, who: str) -> None:
        """Set the latch for a stop over the bus."""
        self._orders += 1
        self.keep(self.latch, partial(self._set_latch, who), _NOT_KEPT)

    def clear_stop(self) -> None:
        """Clear the latch for a reset, unless a newer stop by file is found."""
        self._orders += 1
        self.at_rest = False
        self.keep(self.latch, self._clear_latch, _NOT_KEPT)

    def _set_latch(self, who: str) -> None:
        self.latch.set(who)
        self._seen_ns, self._sender = self.latch.set_ns, who
        if self.problem:
            self._report(self.problem)

    def _clear_latch(self) -> None:
        self._sender = None
        self.latch.clear()

    @property
    def holder(self) -> str | None:
        """The sender of the stop whose file exists; None without one, and until each order over the bus is carried out."""
        orders, sender = self._found
        return sender if orders == self._orders else None

    def _work(self) -> None:
        repeat(self._look, _LOOK_S, self._over, self._report)
        self._look()

    def _look(self) -> None:
        orders = self._orders
        set_ns = self.latch.set_ns
        if set_ns != self._seen_ns:
            self._seen_ns, self._sender = set_ns, self.latch.who() if set_ns else None
            if set_ns:
                self._waiting.pop(self.latch, None)  # it wins over a reset that waits
        while self._waiting:
            state, (write, lost) = self._waiting.popitem()
            if failure := _failure(state, write, lost):
                self._report(failure)
        self._found = orders, self._sender
        self._looks += 1
        if self._looks % _LOOKS == 0:
            self._keep_files()
        if self.at_rest and self._seen_ns not in (0, self._confirmed_ns):
            self._confirmed_ns = self._seen_ns
            lost = "`stickslip stop` has no confirmation by file"
            if failure := _failure(self.rig, partial(self.rig.confirm, self._seen_ns), lost):
                self._report(failure)

    def _keep_files(self) -> None:
        """Make the rig's file, and the latch of a stopped rig, if it was removed or if the disk had no room for it."""
        missing, before = not self.rig.exists, self.problem
        self.problem = self._make_rig_file() if missing else ""
        if self.at_rest and not (self.problem or self._seen_ns):
            missing, self.problem = True, _failure(self.latch, partial(self._set_latch, "the rig"), _NOT_KEPT)
        if self.problem not in ("", before) or (missing and not self.problem):
            self._report(self.problem or f"{self.rig.path.parent}: lacked a file of this rig, which is made again")

    def _make_rig_file(self) -> str:
        self._confirmed_ns = 0
        return _failure(
            self.rig, partial(self.rig.make, self._run), "this rig takes no stop by file, only over the bus"
        )


def _failure(state: StateFile, write: Callable[[], None], lost: str) -> str:
    """Call `write`; returns its failure, which loses `lost`, as text."""
    try:
        write()
    except (OSError, Fault) as error:
        cause = (error.strerror if isinstance(error, OSError) else "") or str(error)
        return f"{state.path}: {cause}: {lost}"
    return ""
