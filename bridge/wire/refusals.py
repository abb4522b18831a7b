"""Sessions that the rig refused: a wrong or missing password or certificate, random bytes, or a connection that sends nothing.

Zenoh reports them in its log alone, which its Python interface writes to file 1 of the process. So this file becomes a pipe, and
stdout gets another number. Messages that a session has no right to send have a line only at the level that logs every message,
so they are not counted.
"""

import contextlib
import os
import re
import sys
import threading
from collections.abc import Callable, Generator

from bridge.threads import repeat
from bridge.wire.session import zenoh

_FILTER = (
    "zenoh_transport::unicast::establishment::accept=debug,zenoh_transport::unicast::manager=debug,zenoh_link_tls=warn"
)
# A line without its colours and the line of Zenoh's source.
_LINE = re.compile(
    r"(zenoh_link_tls|accept|manager)(?:::\w+)*: (.*?)(?:\. Hint: .*| at /\S+\.rs:\d+\.?|:TransportLink.*)?$"
)
_COLOUR = re.compile(r"\x1b\[\d*m")
_ACCEPTED = "New transport link accepted"
_TIMEOUT = "Failed to accept link before deadline"
# Interval of reading. Longer: a flood fills the pipe of 190 lines, and then Zenoh accepts at most 190 sessions in the interval.
_READ_S = 0.1
_READS = 10  # readings between two reports: one event a second at most
_MOST_BYTES = 1 << 20


def refused(line: str) -> str:
    """The cause of a refusal in a line of Zenoh's log; empty for another line."""
    match = _LINE.search(_COLOUR.sub("", line).rstrip())
    if match is None:
        return ""
    place, text = match.groups()
    if (place == "manager" and not text.startswith(_TIMEOUT)) or text.startswith(_ACCEPTED):
        return ""
    return text


def captured() -> int | None:
    """The file from which Zenoh's log of this process can be read; None if `RUST_LOG` is set: the log then stays on stdout.

    Call it before the first session. It lasts as long as the process, because a session logs until its end.
    """
    if "RUST_LOG" in os.environ:
        return None
    sys.stdout.flush()
    sys.stdout = os.fdopen(os.dup(1), "w", encoding=sys.stdout.encoding, errors=sys.stdout.errors)
    read, write = os.pipe()
    os.set_blocking(read, False)
    os.dup2(write, 1)
    os.close(write)
    zenoh.init_log_from_env_or(_FILTER)
    return read


@contextlib.contextmanager
def reported(log: int, report: Callable[[str], object], begun: threading.Event) -> Generator[None]:
    """Report the refused sessions in a log at most once a second in the body: their number and the newest cause.

    Before the run has `begun` they are only counted, as an event without a recorder is lost.
    """
    counted = _Refusals(log, report, begun)
    over = threading.Event()
    thread = threading.Thread(target=repeat, args=(counted.read, _READ_S, over, report), name="refusals", daemon=True)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


class _Refusals:
    """The refused sessions in a log since the last report, and in all."""

    def __init__(self, log: int, report: Callable[[str], object], begun: threading.Event) -> None:
        self._log, self._report, self._begun = log, report, begun
        self._rest = b""
        self._new = self._total = self._ticks = 0
        self._newest = ""

    def read(self) -> None:
        """Count the new lines of the log; report each second."""
        self._ticks += 1
        with contextlib.suppress(BlockingIOError):
            *lines, self._rest = (self._rest + os.read(self._log, _MOST_BYTES)).split(b"\n")
            causes = [cause for line in lines if (cause := refused(line.decode(errors="replace")))]
            self._new, self._newest = self._new + len(causes), causes[-1] if causes else self._newest
        if self._new and self._ticks % _READS == 0 and self._begun.is_set():
            new, self._new = self._new, 0
            self._total += new
            self._report(
                f"{new} sessions refused since the last report, {self._total} in all; the newest: {self._newest}"
            )
