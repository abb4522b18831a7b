"""`stickslip serve`: one local port with the page, the frames of a rig, and the operator's commands to it."""

import asyncio
import contextlib
import http
import json
import logging
import socket
import struct
import threading
import time
from collections.abc import Callable
from typing import Any

import numpy as np
import numpy.typing as npt
from websockets.asyncio.server import ServerConnection, serve
from websockets.datastructures import Headers
from websockets.exceptions import ConnectionClosed
from websockets.http11 import Request, Response

from bridge.faults import Fault
from bridge.plain import print_line
from bridge.results import strict_json
from bridge.wire.channels import CHANNELS
from bridge.wire.words import words
from bridge.wire.zenoh_link import BusConfig
from cockpit.figures.signals import PANELS, Panel
from cockpit.live.buckets import COLUMNS, Buckets
from cockpit.live.listener import Listener
from cockpit.live.operator_link import SCOPE, Words, wish_of
from cockpit.live.page import NO_METHOD, PAGE, Page, refusal
from cockpit.live.trigger import Capture
from cockpit.live.view import View, ViewUpdate

HOST = "127.0.0.1"
PERIOD_S = 0.05  # time between two frames
_LATENCY_S = 1.0  # time between two histograms of the latency
_MOST_CONNECTIONS = 48  # beyond them the oldest connection without a request is closed; if all are pages, the newest
_OPEN_S = 5.0  # timeout for the handshake of a connection
_MOST_BYTES = 1024  # largest message of a page; the longest contains a command and a token
_MOST_WISHES = 4  # unanswered commands of one page
_HEADERS = {
    "Content-Type": "text/html; charset=utf-8",
    "Cache-Control": "no-store",
    "X-Content-Type-Options": "nosniff",
    "X-Frame-Options": "DENY",  # against click-jacking by another site
    "Referrer-Policy": "no-referrer",
    "Cross-Origin-Opener-Policy": "same-origin",
    "Cross-Origin-Resource-Policy": "same-origin",
    "Connection": "close",
}
_ALIGNED = 4  # a browser reads float32 only at offsets divisible by 4
MOST_VIEWERS = 12  # most pages that receive data; further pages may still send commands to the rig
_QUEUED = 60  # queued frames, 3 s. Larger: a slow browser shows older data. Smaller: a slowly drawing one is dropped


def listening(port: int) -> socket.socket:
    """A socket on the loopback address only. Raises Fault ENDPOINT_BUSY."""
    try:
        return socket.create_server((HOST, port))
    except (OSError, OverflowError) as error:
        line = f"{HOST}:{port}: cannot listen there ({error})"
        raise Fault("ENDPOINT_BUSY", f"{line}; end the process that holds it, or choose another --port") from None


class Server:
    """The page of one rig at `port`; `token` permits arming from it. `also` receives each update of the view."""

    def __init__(self, bus: BusConfig, token: str, port: int, also: Callable[[ViewUpdate], None] | None = None) -> None:
        self._port, self._also = port, also
        self._words = Words(bus, token)
        self._listener = Listener(bus)
        self._view = View(self._listener, bus.endpoint)
        self._page = Page(port)
        self._viewers = Viewers()
        self._connections = 0
        self._silent: dict[ServerConnection, None] = {}  # connections without a page yet, oldest first
        self._latency_s = 0.0  # time of the last histogram
        self._trouble = ""  # printed last

    def run(self, sock: socket.socket, stop: threading.Event, ready: Callable[[], None]) -> None:
        """Serve until `stop` is set; `ready` is called once requests are accepted."""
        # Do not log malformed requests of clients.
        logger = logging.getLogger("stickslip.live")
        logger.addHandler(logging.NullHandler())
        logger.propagate = False
        with self._listener:
            asyncio.run(self._serve(sock, stop, ready, logger))

    async def _serve(
        self, sock: socket.socket, stop: threading.Event, ready: Callable[[], None], logger: logging.Logger
    ) -> None:
        outer = self

        class Counted(ServerConnection):
            """Counts the connections; a new connection beyond the limit closes the oldest without a page."""

            def connection_made(self, transport: asyncio.BaseTransport) -> None:
                outer._connections += 1
                outer._silent[self] = None
                super().connection_made(transport)
                if outer._connections > _MOST_CONNECTIONS:
                    oldest = next(iter(outer._silent))
                    del outer._silent[oldest]
                    oldest.transport.abort()

            def connection_lost(self, exc: Exception | None) -> None:
                outer._connections -= 1
                outer._silent.pop(self, None)
                super().connection_lost(exc)

        async with serve(
            self._attend,
            sock=sock,
            process_request=self._answer,
            create_connection=Counted,
            compression=None,  # measured values compress badly, at the cost of CPU time
            max_size=_MOST_BYTES,
            max_queue=_MOST_WISHES,
            open_timeout=_OPEN_S,
            ping_interval=10.0,
            ping_timeout=20.0,
            close_timeout=1.0,
            server_header=None,
            logger=logger,
        ):
            ready()
            due_s = time.monotonic()
            while not stop.is_set():
                self._tick()
                due_s = max(due_s + PERIOD_S, time.monotonic())
                await asyncio.sleep(due_s - time.monotonic())

    def _answer(self, _connection: ServerConnection, request: Request) -> Response | None:
        """The page or a refusal; None to accept a WebSocket."""
        headers = request.headers
        upgrades = "websocket" in headers.get("Upgrade", "").lower()
        names = headers.get_all("Host"), headers.get_all("Origin")
        refused = NO_METHOD if request.method != "GET" else refusal(request.path, *names, self._port, upgrades)
        if refused is not None:
            body = f"{refused.line}\n".encode()
            fields = _HEADERS | {"Content-Type": "text/plain; charset=utf-8", "Content-Length": str(len(body))}
            return Response(refused.status, http.HTTPStatus(refused.status).phrase, Headers(fields), body)
        if request.path != PAGE:
            return None
        fields = _HEADERS | {"Content-Security-Policy": self._page.policy, "Content-Length": str(len(self._page.body))}
        return Response(200, "OK", Headers(fields), self._page.body)

    def _tick(self) -> None:
        step = self._view.step()
        if (trouble := self._listener.presence.trouble) not in ("", self._trouble):
            self._trouble = trouble
            print_line(f"warning  {trouble}")
        if self._also is not None:
            self._also(step)
        if not len(self._viewers):
            return
        if step.new_run:
            self._viewers.broadcast(frame("new-run", self._grid()))
        self._viewers.broadcast(self._now(step))
        if step.capture is not None:
            self._viewers.broadcast(_captured(step.capture))

    def _grid(self) -> dict[str, Any]:
        run = self._view.run
        return {"step_s": run.buckets.step_s if run is not None else None}

    def _now(self, step: ViewUpdate) -> bytes:
        """Frame with the current state, and the new events and buckets."""
        state = self._view.now() | {"events": [event._asdict() for event in step.events]}
        state |= {"viewers": len(self._viewers), "viewers_dropped": self._viewers.dropped, "sent_s": time.monotonic()}
        if time.monotonic() > self._latency_s + _LATENCY_S and self._view.run is not None:
            self._latency_s = time.monotonic()
            state["latency"] = self._view.run.tally.latency_us.bars("us")
        return _bucketed("now", state, step.buckets)

    def _first(self) -> list[bytes]:
        """Frames for a newly opened page: names and words, the last minute, the events and the last capture."""
        run, view = self._view.run, self._view
        kept = run.buckets.kept() if run is not None else None
        hello = {
            "columns": COLUMNS,
            "channels": CHANNELS,
            "panels": [_panel(panel) for panel in PANELS],
            "words": [word._asdict() for word in words()],
            **self._grid(),
        }
        events = [event._asdict() for event in view.events]
        latency = run.tally.latency_us.bars("us") if run is not None else None
        now = view.now() | {"events": events, "latency": latency, "sent_s": time.monotonic()}
        first = [frame("hello", hello), _bucketed("now", now, kept)]
        return [*first, *([_captured(view.capture)] if view.capture is not None else [])]

    async def _attend(self, socket: ServerConnection) -> None:
        """Send a page the state of the rig, and execute its commands."""
        self._silent.pop(socket, None)
        tasks: set[asyncio.Task[None]] = set()
        async with contextlib.AsyncExitStack() as viewing:
            if len(self._viewers) < MOST_VIEWERS:
                await viewing.enter_async_context(self._viewers.added(socket, self._first()))
            else:
                line = f"{MOST_VIEWERS} pages are already open: close one. STOP works on this page, too"
                await socket.send(frame("full", {"line": line}))
            with contextlib.suppress(ConnectionClosed):
                async for message in socket:
                    wish = wish_of(message)
                    if wish is None:
                        return
                    if wish.word == SCOPE:
                        self._view.take_now()
                        continue
                    while len(tasks) >= _MOST_WISHES:
                        await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
                    task = asyncio.create_task(self._run_command(socket, wish))
                    tasks.add(task)
                    task.add_done_callback(tasks.discard)

    async def _run_command(self, socket: ServerConnection, wish: Any) -> None:
        answer = await self._words.deliver(wish)
        with contextlib.suppress(ConnectionClosed):
            await socket.send(frame("answer", answer))


def _bucketed(kind: str, table: dict[str, Any], buckets: Buckets | None) -> bytes:
    if buckets is None:
        return frame(kind, table)
    return frame(kind, table | {"first": buckets.first}, buckets.values)


def _captured(capture: Capture) -> bytes:
    table = {name: value for name, value in capture._asdict().items() if name != "samples"}
    return frame("capture", table, capture.samples)


def _panel(panel: Panel) -> dict[str, Any]:
    curves = [signal.for_page() | {"factor": signal.factor} for signal in panel.signals]
    return panel.heading() | {"curves": curves}


def frame(kind: str, table: dict[str, Any], columns: npt.NDArray[np.float32] | None = None) -> bytes:
    """Bytes of one frame: JSON with its kind, a table and both counts of the columns; the columns, [columns, values]."""
    rows, count = columns.shape if columns is not None else (0, 0)
    header = {"kind": kind, **table, "rows": rows, "count": count}
    text = json.dumps(strict_json(header), allow_nan=False, separators=(",", ":")).encode()
    text += b" " * (-len(text) % _ALIGNED)
    data = np.ascontiguousarray(columns, "<f4").tobytes() if columns is not None else b""
    return struct.pack("<I", len(text)) + text + data


class Viewers:
    """All connected browsers."""

    def __init__(self) -> None:
        self.dropped = 0  # number of browsers dropped as too slow
        self._queues: dict[ServerConnection, asyncio.Queue[bytes]] = {}

    def __len__(self) -> int:
        return len(self._queues)

    def broadcast(self, frame: bytes) -> None:
        """Queue a frame for all; drop a browser whose queue is full."""
        for page, queue in [*self._queues.items()]:
            try:
                queue.put_nowait(frame)
            except asyncio.QueueFull:
                self.dropped += 1
                del self._queues[page]
                # `close` would wait for the stalled reader
                page.transport.abort()

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
