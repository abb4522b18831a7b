"""The live signals for Foxglove and Lichtblick over a WebSocket: the topic `scope` of a log, and events as `foxglove.Log`.

foxglove-sdk (https://docs.foxglove.dev/docs/sdk), installed by the extra `foxglove`, defines the protocol, the port and which
messages a slow client loses. Clients can only read: no capability is offered.
"""

import time
from typing import Any, Self

import numpy as np

from bridge.faults import Fault
from bridge.log.viewers import foxglove_log
from bridge.log.viewers.stretches import ScopeBlocks, Stretches
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import SCOPE
from bridge.wire.payloads import file_descriptor_set
from bridge.wire.topics import SCOPE as SCOPE_TOPIC
from cockpit.live.view import ViewUpdate

HOST = "127.0.0.1"
_FAR_NS = 500_000_000  # disagreement of the computer's and the run's clock above which the run's start is re-estimated


class Foxglove:
    """A server on the loopback address only, at `port` (0: any free port); a context manager.

    Raises Fault ENDPOINT_BUSY, ModuleNotFoundError without the extra.
    """

    def __init__(self, port: int) -> None:
        import foxglove  # pyright: ignore[reportMissingImports]

        self._context: Any = foxglove.Context()  # keep a reference: its channels are deleted with it

        def channel(topic: str, name: str, described: bytes) -> Any:
            schema = foxglove.Schema(name=name, encoding="protobuf", data=described)
            return foxglove.Channel(topic, schema=schema, message_encoding="protobuf", context=self._context)

        described = file_descriptor_set(SCOPE_TOPIC.message)
        self._scope = channel("/" + SCOPE_TOPIC.name, SCOPE_TOPIC.message.DESCRIPTOR.full_name, described)
        log_files = foxglove_log.FILES.SerializeToString()
        self._log = channel("/" + foxglove_log.TOPIC, foxglove_log.SCHEMA, log_files)
        self._stretches = Stretches()
        self._began_ns: int | None = None  # start of the run by this computer's clock
        try:
            self._server: Any = foxglove.start_server(name="stickslip", host=HOST, port=port, context=self._context)
        except (RuntimeError, OSError) as error:
            line = f"{HOST}:{port}: cannot listen there ({error})"
            raise Fault(
                "ENDPOINT_BUSY", f"{line}; end the process that holds it, or choose another --foxglove-port"
            ) from None
        self.port = int(self._server.port)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._server.stop()

    def send(self, step: ViewUpdate) -> None:
        """Send the new blocks and events of a step."""
        if step.new_run:
            self._stretches = Stretches()
            self._began_ns = None
        for topic in ("applied", "trace"):
            if topic in step.tables:
                self._stretches.add(topic, step.tables[topic])
        table = step.tables.get("sensors")
        if table is not None:
            t_ns = table["t_ns"].astype(np.int64)
            samples = np.stack([table[name] for name in CHANNELS])
            records, log_ns = self._stretches.made(ScopeBlocks(t_ns, self._since(t_ns), samples), last=False)
            if records is not None:
                size = SCOPE.size
                data = records.tobytes()
                for number, at_ns in enumerate(log_ns.tolist()):
                    self._scope.log(data[number * size : (number + 1) * size], log_time=at_ns)
        now_ns = time.time_ns()
        for heard in step.events:
            event = wire.Event(source=heard.source, code=heard.code, text=heard.text)
            self._log.log(foxglove_log.of_event(event, now_ns), log_time=now_ns)

    def _since(self, t_ns: Any) -> Any:
        """Times of the run on this computer's clock. Evenly spaced, although blocks arrive in batches."""
        newest_ns = time.time_ns() - int(t_ns[-1])
        if self._began_ns is None or abs(newest_ns - self._began_ns) > _FAR_NS:
            self._began_ns = newest_ns
        return t_ns + self._began_ns
