"""Which requests are answered: those of the page that was opened on this computer, under the names that the page may have.

A page of another site can send a browser here, and a name that an attacker owns can lead to 127.0.0.1: the first is told by
`Origin`, the second by `Host`.
"""

from collections.abc import Sequence
from typing import NamedTuple

PAGE, STREAM = "/", "/stream"
NAMES = ("127.0.0.1", "localhost")


class Refusal(NamedTuple):
    """An HTTP status, and a line for a person."""

    status: int
    line: str


NO_METHOD = Refusal(405, "GET alone")


def refusal(path: str, hosts: Sequence[str], origins: Sequence[str], port: int, upgrades: bool) -> Refusal | None:
    """Why a request is not answered; None where it is.

    Args:
        path: of the request, as it came.
        hosts: every value of the header `Host`.
        origins: every value of the header `Origin`.
        port: that the server listens at.
        upgrades: whether the request wants a web socket.

    """
    names = [f"{name}:{port}" for name in NAMES]
    if len(hosts) != 1 or hosts[0].lower() not in names:
        return Refusal(421, f"Host must be {' or '.join(names)}: open the page under one of these")
    if path not in (PAGE, STREAM):
        return Refusal(404, f"there is {PAGE} alone")
    if path == PAGE:
        return None
    if len(origins) != 1 or origins[0].lower() not in [f"http://{name}" for name in names]:
        return Refusal(403, "Origin must be that of the page: another site may not listen, and not say a word to a rig")
    return None if upgrades else Refusal(426, "this path is a web socket")
