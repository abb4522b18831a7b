"""The clock that the processes of a run read: the machine's, or that of a simulated run, which stands still while it computes."""

import time as _machine
from collections.abc import Callable, Generator
from contextlib import contextmanager


class Clock:
    """The functions of `time` that processes keep time with; `time` below is the one that all modules share."""

    def __init__(self) -> None:
        self._use_the_machine()

    def _use_the_machine(self) -> None:
        self.monotonic: Callable[[], float] = _machine.monotonic
        self.perf_counter_ns: Callable[[], int] = _machine.perf_counter_ns
        self.sleep: Callable[[float], None] = _machine.sleep

    @contextmanager
    def simulated(self, now_ns: Callable[[], int], sleep: Callable[[float], None]) -> Generator[None]:
        """Let this process live in simulated time.

        Args:
            now_ns: the time [ns].
            sleep: returns when so much time [s] has passed.

        """
        self.monotonic = lambda: now_ns() * 1e-9
        self.perf_counter_ns = now_ns
        self.sleep = sleep
        try:
            yield
        finally:
            self._use_the_machine()


time = Clock()
