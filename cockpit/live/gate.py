"""Filter of HTTP requests: answers only the page opened on this computer under its permitted names.

`Origin` exposes a page of another site that sends the browser here; `Host` exposes an attacker's domain name that resolves to
127.0.0.1.
"""

from collections.abc import Sequence
from typing import NamedTuple

PAGE, STREAM = "/", "/stream"
NAMES = ("127.0.0.1", "localhost")


class Refusal(NamedTuple):
    """An HTTP status and a readable line."""

    status: int
    line: str


NO_METHOD = Refusal(405, "only GET is allowed")


def refusal(path: str, hosts: Sequence[str], origins: Sequence[str], port: int, upgrades: bool) -> Refusal | None:
    """Reason for which a request is refused; None if it is accepted.

    Args:
        path: path of the request, unchanged.
        hosts: every value of the header `Host`.
        origins: every value of the header `Origin`.
        port: port of the server.
        upgrades: whether the request wants a web socket.

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
