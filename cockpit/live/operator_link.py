"""Operator commands from the page: STOP for every viewer; arm, disarm and reset for holders of the token."""

import asyncio
import json
import secrets
import time
from typing import Any, NamedTuple

from bridge.faults import Fault
from bridge.plain import plain
from bridge.wire.zenoh_link import BusConfig
from cockpit.live.operator import send_command

STOP, SCOPE = "STOP", "SCOPE"
_WITH_TOKEN = ("ARM", "DISARM", "RESET")
_WRONG_S = 1.0  # time for which a wrong token blocks further attempts, against guessing
_STOP_S = 3.0  # time for which an undelivered STOP is repeated; the last attempt takes 2 s more
_STOP_AGAIN_S = 0.2  # pause before a repetition


class Wish(NamedTuple):
    """A command requested by a page."""

    word: str
    token: str


def wish_of(message: str | bytes) -> Wish | None:
    """Parse a message; None if it is malformed."""
    try:
        table: Any = json.loads(message)
    except (ValueError, RecursionError):
        return None
    if not isinstance(table, dict):
        return None
    word, token = table.get("word"), table.get("token", "")
    if word not in (STOP, SCOPE, *_WITH_TOKEN) or not isinstance(token, str):
        return None
    return Wish(word, token)


class Words:
    """Sends commands to the rig as the role operator, one at a time. STOP never waits for another command.

    Args:
        bus: bus of the rig.
        token: token that the page must send.

    """

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
        while True:
            try:
                outcome = await asyncio.to_thread(send_command, self._bus, command)
            except Fault as fault:
                if fault.kind.code != "NO_PEER" or time.monotonic() > until_s:
                    return _answer(command, False, [fault.line])
                await asyncio.sleep(_STOP_AGAIN_S)
            else:
                return _answer(command, outcome.done, outcome.in_words())


def _answer(command: str, done: bool, lines: list[str]) -> dict[str, Any]:
    return {"word": command, "done": done, "lines": [plain(line) for line in lines]}
