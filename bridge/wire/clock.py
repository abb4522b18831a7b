"""The clock of the processes of a run: the computer's, or simulated time, which does not advance while a process computes."""

import time as _machine
from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from typing import NamedTuple


class Wait(NamedTuple):
    """A wait of a loop, which the loop yields in simulated time; by the computer's clock it blocks and yields nothing."""

    for_s: float
    hears: bool = False  # a message for the loop ends it early


class Clock:
    """The functions of the module `time` that processes use; all modules share the instance `time` below."""

    def __init__(self) -> None:
        self._use_the_computer()

    def wait(self, for_s: float) -> Iterable[Wait]:
        """Wait; a loop uses `yield from time.wait(...)`."""
        if self.is_simulated:
            return (Wait(for_s),)
        self.sleep(for_s)
        return ()

    def _use_the_computer(self) -> None:
        self.is_simulated = False
        self.monotonic: Callable[[], float] = _machine.monotonic
        self.perf_counter_ns: Callable[[], int] = _machine.perf_counter_ns
        self.sleep: Callable[[float], None] = _machine.sleep

    @contextmanager
    def simulated(self, now_ns: Callable[[], int], sleep: Callable[[float], None]) -> Generator[None]:
        """Run this process in simulated time.

        Args:
            now_ns: the time [ns].
            sleep: lets a simulated time [s] pass within a call.

        """
        self.is_simulated = True
        self.monotonic = lambda: now_ns() * 1e-9
        self.perf_counter_ns = now_ns
        self.sleep = sleep
        try:
            yield
        finally:
            self._use_the_computer()


def carry_out(loop: Iterable[Wait]) -> None:
    """Run a loop by the computer's clock."""
    for _ in loop:
        raise RuntimeError("a loop in simulated time needs the scheduler of that time")


time = Clock()
