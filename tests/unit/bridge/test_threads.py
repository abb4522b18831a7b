"""Work that a thread repeats goes on after an error."""

import threading

from bridge.threads import repeat


def test_an_error_is_reported_once_in_a_while_and_ends_nothing() -> None:
    over, lines = threading.Event(), []
    calls = iter(range(5))

    def work() -> None:
        if next(calls) == 4:
            over.set()
        raise OSError(24, "Too many open files", "/proc/self/fd")

    def report(line: str) -> None:
        lines.append(line)
        raise RuntimeError("the session is closed")

    repeat(work, 0.0, over, report)
    assert (over.is_set(), len(lines)) == (True, 1)
    assert lines[0].endswith("Too many open files: '/proc/self/fd'; tried again")
