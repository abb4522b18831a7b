"""Refused sessions, counted from Zenoh's log."""

import subprocess
import sys

import pytest

from bridge.wire.refusals import refused

_LINE = "\x1b[2m2026-11-29T23:30:52Z\x1b[0m \x1b[34m{}\x1b[0m acc-0 ThreadId(04) \x1b[2mzenoh_{}\x1b[0m\x1b[2m:\x1b[0m "
ACCEPT = _LINE.format("DEBUG", "transport::unicast::establishment::accept")
MANAGER = _LINE.format("DEBUG", "transport::unicast::manager")
TLS = _LINE.format(" WARN", "link_tls::unicast")


@pytest.mark.parametrize(
    ("line", "cause"),
    [
        (
            f"{ACCEPT}UsrPwd extension - Recv OpenSyn. Invalid password. at /x/usrpwd.rs:424.",
            "UsrPwd extension - Recv OpenSyn. Invalid password.",
        ),
        (
            f"{ACCEPT}Read error from link: tcp/127.0.0.1:1 => tcp/127.0.0.1:2:TransportLinkUnicastConfig {{ direction: Inbound",
            "Read error from link: tcp/127.0.0.1:1 => tcp/127.0.0.1:2",
        ),
        (f"{TLS}peer sent no certificates. Hint: increase the system open file limit.", "peer sent no certificates"),
        (f"{MANAGER}Failed to accept link before deadline (1000ms)", "Failed to accept link before deadline (1000ms)"),
        (f"{MANAGER}New transport opened between 74d5 and 3516", ""),
        (f"{ACCEPT}New transport link accepted from 3516 to 74d5: TransportLinkUnicast {{ link", ""),
        ("", ""),
    ],
)
def test_a_line_of_the_log_gives_the_cause(line: str, cause: str) -> None:
    assert refused(line) == cause


def test_the_log_is_counted_and_stdout_stays(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.delenv("RUST_LOG", raising=False)
    code = f"""
import os, threading, time
from bridge.wire import refusals
log = refusals.captured()
refusals._READS = 1
lines = []
begun = threading.Event()
begun.set()
with refusals.reported(log, lines.append, begun):
    os.write(1, {(TLS + "peer sent no certificates. Hint: x" + chr(10)).encode()!r} * 3)
    while not lines:
        time.sleep(0.01)
print(lines)
"""
    done = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60)
    assert (
        done.stdout == "['3 sessions refused since the last report, 3 in all; the newest: peer sent no certificates']\n"
    )
