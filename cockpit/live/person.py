"""A person's words from the page: STOP of everybody who sees it; arm, disarm and reset of who has the token."""

import asyncio
import json
import secrets
from typing import Any, NamedTuple

from bridge.faults import Fault
from bridge.plain import plain
from bridge.wire.zenoh_link import BusConfig
from cockpit.run.operator import tell

STOP, SCOPE = "STOP", "SCOPE"
_WITH_TOKEN = ("ARM", "DISARM", "RESET")
_WRONG_S = 1.0  # for which a wrong token keeps the only place: nobody tries many


class Wish(NamedTuple):
    """What a page asks for."""

    word: str
    token: str


def wish_of(message: str | bytes) -> Wish | None:
    """What a message says; None for what is none."""
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
    """Says words to the rig, as the role operator, one at a time; STOP waits for no other.

    Args:
        bus: where.
        token: of this server.

    """

    def __init__(self, bus: BusConfig, token: str) -> None:
        self._bus, self._token = bus, token
        self._stopping: asyncio.Task[dict[str, Any]] | None = None
        self._busy = False

    async def say(self, wish: Wish) -> dict[str, Any]:
        """What came of it: `word`, `done` and `lines` for a person."""
        if wish.word == STOP:
            if self._stopping is None or self._stopping.done():
                self._stopping = asyncio.create_task(self._told(STOP))
            return await asyncio.shield(self._stopping)
        if self._busy:
            return _answer(wish.word, False, ["another word is under way; say this one after it"])
        self._busy = True
        try:
            if not secrets.compare_digest(wish.token.encode(errors="surrogatepass"), self._token.encode()):
                await asyncio.sleep(_WRONG_S)
                return _answer(wish.word, False, ["not the token that `stickslip serve` printed when it began"])
            return await self._told(wish.word)
        finally:
            self._busy = False

    async def _told(self, word: str) -> dict[str, Any]:
        try:
            obeyed = await asyncio.to_thread(tell, self._bus, word)
        except Fault as fault:
            return _answer(word, False, [fault.line])
        return _answer(word, obeyed.done, obeyed.in_words())


def _answer(word: str, done: bool, lines: list[str]) -> dict[str, Any]:
    return {"word": word, "done": done, "lines": [plain(line) for line in lines]}
