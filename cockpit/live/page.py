"""The live page, one self-contained HTML file, and the requests that are answered.

Only the page opened on this computer under its permitted names is answered. `Origin` exposes a page of another site that sends
the browser here; `Host` exposes an attacker's domain name that resolves to 127.0.0.1.
"""

import base64
import hashlib
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

from cockpit.review.page import page_of_curves, text_of

_FOLDER = Path(__file__).parent
_SCRIPTS = ("store.js", "state.js", "scope.js", "command.js", "live.js")
_NO_ICON = '<link rel="icon" href="data:,">\n'  # an empty icon, so that the browser requests none
PAGE, STREAM = "/", "/stream"
NAMES = ("127.0.0.1", "localhost")


class Page:
    """The page of a server at `port` as bytes, with its content security policy."""

    def __init__(self, port: int) -> None:
        body = text_of(_FOLDER / "live.html")
        page = page_of_curves("stickslip: waiting", body, _NO_ICON, [_FOLDER / name for name in _SCRIPTS])
        self.body = page.encode()
        # only the scripts of this page may run, and the page may connect to this server only
        scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
        hashes = " ".join(f"'sha256-{_sha256(script)}'" for script in scripts)
        streams = " ".join(f"ws://{name}:{port}" for name in NAMES)
        self.policy = (
            f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:; connect-src {streams}; "
            "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
        )


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()


class Refusal(NamedTuple):
    """An HTTP status and a readable line."""

    status: int
    line: str


NO_METHOD = Refusal(405, "only GET is allowed")


def refusal(path: str, hosts: Sequence[str], origins: Sequence[str], port: int, upgrades: bool) -> Refusal | None:
    """Reason for which a request is refused; None if it is accepted.

    `hosts` and `origins` are all values of the headers `Host` and `Origin`; `upgrades`: the request wants a web socket.
    """
    names = [f"{name}:{port}" for name in NAMES]
    if len(hosts) != 1 or hosts[0].lower() not in names:
        return Refusal(421, f"Host must be {' or '.join(names)}: open the page under one of these")
    if path not in (PAGE, STREAM):
        return Refusal(404, f"not found; the page is {PAGE}")
    if path == PAGE:
        return None
    if len(origins) != 1 or origins[0].lower() not in [f"http://{name}" for name in names]:
        return Refusal(
            403, "Origin must be the page itself: other sites may neither read from a rig nor send it commands"
        )
    return None if upgrades else Refusal(426, "this path is a WebSocket")
