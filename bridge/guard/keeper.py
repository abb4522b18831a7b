"""The thread of a rig that writes and watches its state files: a slow disk delays no block and no fade."""

import contextlib
import threading
from collections.abc import Callable, Generator
from functools import partial

from bridge.faults import Fault
from bridge.guard.kept import StateFile, StopLatch
from bridge.guard.stop_file import RigFile

# Interval at which the latch is looked at. Longer: a stop by file begins later. Shorter: 30 us of the Python lock for each look.
_LOOK_S = 0.01
_NOT_KEPT = "the order does not outlast a restart"
_LAST_WRITES_S = 2.0  # longest wait at the end of a rig for a slow disk


class Keeper:
    """Writes the newest state of each kind, finds a stop by file, and confirms it once the rig is at rest.

    The rig's loop takes `stop_by_file` and sets `at_rest` for each block; the thread does all work on files.

    Args:
        latch: the operator's stop.
        rig: the file in which stops are confirmed.

    """

    def __init__(self, latch: StopLatch, rig: RigFile) -> None:
        self.latch = latch
        self.at_rest = False  # whether the rig is in FAULT, without vibration
        self._rig = rig
        self._report: Callable[[str], object] = print
        self._seen_ns = latch.set_ns  # time of the last stop that was found or written
        self._confirmed_ns = 0
        self._sender: str | None = None  # sender of a stop by file that the loop has not taken yet
        self._waiting: dict[StateFile, tuple[Callable[[], None], str]] = {}
        self._over = threading.Event()

    @contextlib.contextmanager
    def running(self, run: int, report: Callable[[str], object]) -> Generator[None]:
        """Keep states and find stops in the body.

        Args:
            run: number of the rig's run.
            report: reports a state that could not be kept, as text.

        """
        self._report = report
        try:
            if not self.latch.outlasts:
                self.latch.clear()
            self._rig.make(run)
        except (OSError, Fault) as error:
            report(f"{self._rig.path}: {_cause(error)}: this rig takes no stop by file, only over the bus")
        thread = threading.Thread(target=self._work, name="keep", daemon=True)
        thread.start()
        try:
            yield
        finally:
            self._over.set()
            thread.join(_LAST_WRITES_S)
            with contextlib.suppress(OSError):
                self._rig.remove()
                if not self.latch.outlasts:
                    self.latch.clear()

    def keep(self, state: StateFile, write: Callable[[], None], lost: str) -> None:
        """Call `write` soon, in place of an earlier one of this state that still waits; a failure loses `lost`."""
        self._waiting[state] = write, lost

    def keep_stop(self, who: str) -> None:
        """Set the latch for a stop over the bus."""
        self.keep(self.latch, partial(self._set_latch, who), _NOT_KEPT)

    def clear_stop(self) -> None:
        """Clear the latch for a reset, unless a newer stop by file is found."""
        self.keep(self.latch, self.latch.clear, _NOT_KEPT)

    def _set_latch(self, who: str) -> None:
        self.latch.set(who)
        self._seen_ns = self.latch.set_ns

    def stop_by_file(self) -> str | None:
        """The sender of a new stop by file, once; None without one."""
        sender, self._sender = self._sender, None
        return sender

    def _work(self) -> None:
        while not self._over.wait(_LOOK_S):
            self._look()
        self._look()

    def _look(self) -> None:
        set_ns = self.latch.set_ns
        if set_ns not in (0, self._seen_ns):
            self._waiting.pop(self.latch, None)  # it wins over a reset that waits
            self._seen_ns, self._sender = set_ns, self.latch.who()
        while self._waiting:
            state, (write, lost) = self._waiting.popitem()
            try:
                write()
            except (OSError, Fault) as error:
                self._report(f"{state.path}: {_cause(error)}: {lost}")
        if self.at_rest and self._sender is None and self._seen_ns not in (0, self._confirmed_ns):
            try:
                self._rig.confirm(self._seen_ns)
            except OSError as error:
                self._report(f"{self._rig.path}: {_cause(error)}: `stickslip stop` has no confirmation by file")
            self._confirmed_ns = self._seen_ns


def _cause(error: OSError | Fault) -> str:
    return (error.strerror if isinstance(error, OSError) else "") or str(error)
