"""Operator commands from the page: STOP for every viewer; arm, disarm and reset for holders of the token.

The token is readable on the terminal and in a file of this user only.
"""

import asyncio
import contextlib
import os
import secrets
import tempfile
import time
from collections.abc import Generator
from functools import partial
from pathlib import Path
from typing import Any, Literal, NamedTuple

from pydantic import TypeAdapter, ValidationError

from bridge.faults import Fault
from bridge.guard.stop_file import order
from bridge.plain import plain
from bridge.wire.loopback_users import folders, is_private_folder
from bridge.wire.zenoh_link import BusConfig
from cockpit.first_stop import sender
from cockpit.live.operator import send_command, stop_rig

STOP, SCOPE = "STOP", "SCOPE"
_WRONG_S = 1.0  # time for which a wrong token blocks further attempts, against guessing
_STOP_S = 3.0  # time for which an undelivered STOP is repeated; the last attempt takes 2 s more
_STOP_AGAIN_S = 0.2  # pause before a repetition
_BYTES = 18  # random bytes of the token; 24 characters in base64


class Wish(NamedTuple):
    """A command requested by a page."""

    word: Literal["STOP", "SCOPE", "ARM", "DISARM", "RESET"]
    token: str = ""


_WISH = TypeAdapter(Wish)


def wish_of(message: str | bytes) -> Wish | None:
    """Parse a message of a page; None if it is malformed."""
    try:
        return _WISH.validate_json(message, strict=True)
    except ValidationError:
        return None


class Words:
    """Sends commands of pages with `token` to the rig, one at a time. STOP needs no token and waits for no other command."""

    def __init__(self, bus: BusConfig, token: str) -> None:
        self._bus, self._token = bus, token
        self._stopping: asyncio.Task[dict[str, Any]] | None = None
        self._busy = False

    async def deliver(self, wish: Wish) -> dict[str, Any]:
        """Send a command; returns its outcome as `word`, `done` and readable `lines`."""
        if wish.word == STOP:
            if self._stopping is None or self._stopping.done():
                self._stopping = asyncio.create_task(self._send(STOP))
            return await asyncio.shield(self._stopping)
        if self._busy:
            return _answer(wish.word, False, ["another command is in progress; repeat this one after it"])
        self._busy = True
        try:
            if not secrets.compare_digest(wish.token.encode(errors="surrogatepass"), self._token.encode()):
                await asyncio.sleep(_WRONG_S)
                return _answer(
                    wish.word, False, ["wrong token: use the token that `stickslip serve` printed at its start"]
                )
            return await self._send(wish.word)
        finally:
            self._busy = False

    async def _send(self, command: str) -> dict[str, Any]:
        until_s = time.monotonic() + (_STOP_S if command == STOP else 0.0)
        orders = await asyncio.to_thread(order, self._bus.endpoint, sender()) if command == STOP else []
        while True:
            try:
                outcome = await asyncio.to_thread(stop_rig, partial(send_command, self._bus, command), orders)
            except Fault as fault:
                if fault.kind.code != "NO_PEER" or time.monotonic() > until_s:
                    return _answer(command, False, [fault.line])
                await asyncio.sleep(_STOP_AGAIN_S)
            else:
                return _answer(command, outcome.done, outcome.in_words())


def _answer(command: str, done: bool, lines: list[str]) -> dict[str, Any]:
    return {"word": command, "done": done, "lines": [plain(line) for line in lines]}


@contextlib.contextmanager
def kept_token(port: int) -> Generator[tuple[str, Path]]:
    """A new token and its file, mode 0600, deleted at the end of the context.

    Raises Fault NOT_SECURE without a folder that other users cannot read.
    """
    token = secrets.token_urlsafe(_BYTES)
    path = _write_private(f"page-{port}.token", token)
    try:
        yield token, path
    finally:
        with contextlib.suppress(OSError):
            if path.read_text() == token:  # unless a later server of this port has replaced it
                path.unlink()


def _write_private(name: str, token: str) -> Path:
    for folder in folders():
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not is_private_folder(folder):
                continue
            handle, part = tempfile.mkstemp(dir=folder)  # mode 0600
            with os.fdopen(handle, "w") as file:
                file.write(token)
            os.replace(part, folder / name)
            return folder / name
    places = ", ".join(str(folder) for folder in folders())
    line = f"no private folder for the page's token: {places} must belong to this user, mode 0700"
    raise Fault("NOT_SECURE", f"{line}; set XDG_RUNTIME_DIR to such a folder")
