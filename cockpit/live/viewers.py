"""Connected browsers: each has a short queue of frames, and a browser whose queue overflows is dropped."""

import asyncio
import contextlib

from websockets.asyncio.server import ServerConnection
from websockets.exceptions import ConnectionClosed

MOST_VIEWERS = 12  # most pages that receive data; further pages may still send commands to the rig
_QUEUED = 60  # queued frames, 3 s. Larger: a slow browser shows older data. Smaller: a slowly drawing one is dropped


class Viewers:
    """All connected browsers."""

    def __init__(self) -> None:
        self.dropped = 0  # number of browsers dropped as too slow
        self._queues: dict[ServerConnection, asyncio.Queue[bytes]] = {}

    def __len__(self) -> int:
        return len(self._queues)

    def broadcast(self, frame: bytes) -> None:
        """Queue a frame for all; drop a browser whose queue is full."""
        for socket, queue in [*self._queues.items()]:
            try:
                queue.put_nowait(frame)
            except asyncio.QueueFull:
                self.dropped += 1
                del self._queues[socket]
                # `close` would wait for the stalled reader
                socket.transport.abort()

    @contextlib.asynccontextmanager
    async def added(self, socket: ServerConnection, first: list[bytes]):
        """Send a browser `first`, then each frame, until the end of the context."""
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
