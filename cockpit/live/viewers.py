"""Browsers that are connected: each has a short queue of frames, and one that does not empty it is dropped."""

import asyncio
import contextlib

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

MOST_VIEWERS = 12  # who comes later may still say a word to the rig, and sees nothing
_QUEUED = 60  # frames, 3 s. Larger: who is slow sees what is past; smaller: a browser that draws for long is dropped
_TOO_SLOW = 1013  # "try again later"


class Viewers:
    """All of them."""

    def __init__(self) -> None:
        self.dropped = 0  # that were too slow
        self._queues: dict[ServerConnection, asyncio.Queue[bytes]] = {}

    def __len__(self) -> int:
        return len(self._queues)

    def tell(self, frame: bytes) -> None:
        """Queue a frame for everybody; who has too many waiting is dropped."""
        for socket, queue in [*self._queues.items()]:
            try:
                queue.put_nowait(frame)
            except asyncio.QueueFull:
                self.dropped += 1
                del self._queues[socket]
                # not `close`, which waits for a reader that does not read
                socket.transport.abort()

    @contextlib.asynccontextmanager
    async def added(self, socket: ServerConnection, first: list[bytes]):
        """A browser that gets `first`, and then each frame, until the end of the block."""
        queue: asyncio.Queue[bytes] = asyncio.Queue(_QUEUED)
        for frame in first:
            queue.put_nowait(frame)
        self._queues[socket] = queue
        sending = asyncio.create_task(self._send(socket, queue))
        try:
            yield
        finally:
            self._queues.pop(socket, None)
            sending.cancel()

    async def _send(self, socket: ServerConnection, queue: asyncio.Queue[bytes]) -> None:
        with contextlib.suppress(ConnectionClosed):
            while True:
                await socket.send(await queue.get())
