"""The clock of the processes of a run: the computer's, or simulated time, which does not advance while a process computes."""

import time as _machine
from collections.abc import Callable, Generator
from contextlib import contextmanager


class Clock:
    """The functions of the module `time` that processes use; all modules share the instance `time` below."""

    def __init__(self) -> None:
        self._use_the_computer()

    def _use_the_computer(self) -> None:
        self.monotonic: Callable[[], float] = _machine.monotonic
        self.perf_counter_ns: Callable[[], int] = _machine.perf_counter_ns
        self.sleep: Callable[[float], None] = _machine.sleep

    @contextmanager
    def simulated(self, now_ns: Callable[[], int], sleep: Callable[[float], None]) -> Generator[None]:
        """Run this process in simulated time.

        Args:
            now_ns: the time [ns].
            sleep: waits for a simulated time [s].

        """
        self.monotonic = lambda: now_ns() * 1e-9
        self.perf_counter_ns = now_ns
        self.sleep = sleep
        try:
            yield
        finally:
            self._use_the_computer()


time = Clock()
