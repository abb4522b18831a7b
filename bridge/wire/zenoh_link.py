"""The bus: one Zenoh session of one process, on an explicit endpoint, without scouting.

The plant listens. All other processes connect to the plant as clients, and the plant relays their messages, so only one side of a
connection dials. Receiving threads copy bytes into bounded queues and do nothing else: publishing from a callback can deadlock.
"""

import contextlib
import ctypes
import json
import os
import queue
import threading
import time
import uuid
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Annotated, Any, NamedTuple, Self

# Zenoh reads this when it is imported. One thread in place of five: a message hops from thread to thread on its way otherwise.
os.environ.setdefault(
    "ZENOH_RUNTIME",
    "(rx: (worker_threads: 1), net: (handover: rx), acc: (handover: rx), tx: (handover: rx), app: (handover: rx))",
)
import zenoh
from pydantic import Field, field_validator

from bridge.config import Strict
from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import parsed
from bridge.wire.topics import Topic

_CONNECT_S = 30.0  # time to wait for the plant; a first start compiles before it listens, which can take more than 10 s
_DIAL_S = 2.0  # largest duration of one attempt; longer delays a stop, as Zenoh cannot be stopped while it dials


class BusConfig(Strict):
    """Address and key prefix of the bus of one rig."""

    endpoint: Annotated[str, Field(pattern=r"^tcp/.+:\d{1,5}$")] = "tcp/127.0.0.1:7447"
    prefix: Annotated[str, Field(pattern=r"^[^/*$?#]+(/[^/*$?#]+)*$")] = "rig"

    @property
    def port(self) -> int:
        """The port of the endpoint."""
        return int(self.endpoint.rpartition(":")[2])

    @field_validator("endpoint")
    @classmethod
    def _port_exists(cls, endpoint: str) -> str:
        if not 1 <= int(endpoint.rpartition(":")[2]) <= 65535:
            raise ValueError(f"{endpoint!r}: the port must be from 1 to 65535; choose another, for example 7447")
        return endpoint


_of_thread = threading.local()


def _keep_thread_state() -> None:
    """Keep what Python knows of the present thread of Zenoh until the thread ends.

    Otherwise Python makes it anew for every callback, which costs a page fault a message.
    """
    if not hasattr(_of_thread, "kept"):
        ctypes.pythonapi.PyGILState_Ensure()
        _of_thread.kept = True


class Received(NamedTuple):
    """One received message."""

    topic: Topic
    payload: bytes
    arrival_ns: int  # time.perf_counter_ns


class Inbox:
    """A bounded queue between a receiving thread and a loop; a message that does not fit is dropped and counted.

    A `patient` inbox waits instead, which blocks the sender. It is for lockstep, where no message may be lost and none is late.
    """

    def __init__(self, limit: int, patient: bool = False) -> None:
        self.dropped = 0
        self._patient = patient
        self._limit = limit
        self._queue: queue.SimpleQueue[Received] = queue.SimpleQueue()

    def push(self, received: Received) -> None:
        """Add a message; called by receiving threads."""
        while self._patient and self._queue.qsize() >= self._limit:
            time.sleep(0.001)
        if self._queue.qsize() >= self._limit:
            self.dropped += 1
        else:
            self._queue.put(received)

    def keep(self, received: Received) -> None:
        """Add a message that is never dropped; for rare messages that must not be missed."""
        self._queue.put(received)

    def get(self, timeout_s: float) -> Received | None:
        """The oldest message, or None when none came within `timeout_s`."""
        try:
            return self._queue.get(timeout=timeout_s)
        except queue.Empty:
            return None

    def get_nowait(self) -> Received | None:
        """The oldest message, or None."""
        try:
            return self._queue.get_nowait()
        except queue.Empty:
            return None


def session_config(config: BusConfig, hub: bool, lockstep: bool, dial_s: float = _DIAL_S) -> zenoh.Config:
    """The settings of a session; `hub` is the session that listens, any other dials for `dial_s`."""
    settings: dict[str, Any] = {
        "mode": "peer" if hub else "client",
        "listen/endpoints": [config.endpoint] if hub else [],
        "connect/endpoints": [] if hub else [config.endpoint],
        "connect/timeout_ms": 0 if hub else round(dial_s * 1e3),
        "connect/exit_on_failure": not hub,
        "connect/retry": {"period_init_ms": 20, "period_max_ms": 20, "period_increase_factor": 1},
        "scouting/multicast/enabled": False,
        "scouting/gossip/enabled": False,
        # Time [ms] after which a silent peer is dropped. Too long: puts wait for a frozen process. Too short: a computer that
        # pauses for as long closes the link and makes it again, which loses messages (docs/method/bridge.md).
        "transport/link/tx/lease": 10_000 if lockstep else 100,
        "transport/link/tx/keep_alive": 4,
        # Depth of the queues, 2 by default. Too small: late answers; counted: docs/method/bridge.md.
        "transport/link/tx/queue/size/real_time": 16,
        "transport/link/tx/queue/size/data": 16,
        "transport/shared_memory/enabled": False,
    }
    result = zenoh.Config()
    for key, value in settings.items():
        result.insert_json5(key, json.dumps(value))
    return result


def _listening(config: BusConfig, lockstep: bool) -> zenoh.Session:
    try:
        return zenoh.open(session_config(config, hub=True, lockstep=lockstep))
    except zenoh.ZError as error:
        line = f"{config.endpoint}: cannot listen there: must be free, and an address of this machine ({_brief(error)})"
        raise Fault("ENDPOINT_BUSY", f"{line}; end what holds it or choose another --endpoint") from None


def _dialled(config: BusConfig, lockstep: bool, stop: threading.Event, patience_s: float) -> zenoh.Session:
    until_s = time.monotonic() + patience_s
    while not stop.is_set():
        try:
            return zenoh.open(session_config(config, False, lockstep, min(_DIAL_S, patience_s)))
        except zenoh.ZError:
            if time.monotonic() > until_s:
                line = f"{config.endpoint}: no plant answers there after {patience_s:g} s"
                raise Fault("NO_PEER", f"{line}; start `stickslip plant` with this --endpoint") from None
    raise Fault("NO_PEER", f"{config.endpoint}: no plant answered there before the stop")


class Bus:
    """The session of one role. Use as a context manager: an unclosed session hangs the process at its end."""

    def __init__(
        self,
        config: BusConfig,
        role: str,
        lockstep: bool,
        stop: threading.Event | None = None,
        patience_s: float = _CONNECT_S,
    ) -> None:
        """Listen as the plant; any other role dials the plant for `patience_s` or until `stop` is set.

        Raises Fault ENDPOINT_BUSY, NO_PEER.
        """
        self._config = config
        self._role = role
        self._lockstep = lockstep
        self._keep: list[Any] = []
        self._alive: set[str] = set()
        self._claims: set[str] = set()
        self._alive_changed = threading.Condition()
        zenoh.init_log_from_env_or("off")
        self._session = (
            _listening(config, lockstep)
            if role == "plant"
            else _dialled(config, lockstep, stop or threading.Event(), patience_s)
        )
        self._keep.append(
            self._session.liveliness().declare_subscriber(
                self._key("alive/*"), zenoh.handlers.Callback(self._on_alive, indirect=False), history=True
            )
        )

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with contextlib.suppress(zenoh.ZError):
            self._session.close()

    def _key(self, name: str) -> str:
        return f"{self._config.prefix}/{name}"

    def _on_alive(self, sample: Any) -> None:
        self._keep_up(self._alive, sample)

    def _on_claim(self, sample: Any) -> None:
        self._keep_up(self._claims, sample)

    def _keep_up(self, names: set[str], sample: Any) -> None:
        """Add the last part of a token's key to `names`, or remove it when the token has gone."""
        name = str(sample.key_expr).rsplit("/", 1)[-1]
        with self._alive_changed:
            if sample.kind == zenoh.SampleKind.PUT:
                names.add(name)
            else:
                names.discard(name)
            self._alive_changed.notify_all()

    def publisher(self, topic: Topic) -> Callable[[bytes], None]:
        """A function that sends bytes on `topic`.

        Sensors, announcements and commands have priority; what one role sends of them comes in the order of sending. In real
        time a message that cannot be sent is dropped; in lockstep the call waits.
        """
        control = topic.name in {"sensors", "command", "announce"}
        block = zenoh.CongestionControl.BLOCK
        declared = self._session.declare_publisher(
            self._key(topic.name),
            encoding=zenoh.Encoding.APPLICATION_PROTOBUF,
            priority=zenoh.Priority.REAL_TIME if control else zenoh.Priority.DATA,
            congestion_control=block if self._lockstep else zenoh.CongestionControl.DROP,
            express=control,
        )
        self._keep.append(declared)
        return declared.put

    def listen(self, topic: Topic, receive: Callable[[Received], None]) -> None:
        """Call `receive` for every message of `topic`, on a receiving thread: `receive` must only store the message."""

        def on_sample(sample: Any) -> None:
            _keep_thread_state()
            receive(Received(topic, sample.payload.to_bytes(), time.perf_counter_ns()))

        handler = zenoh.handlers.Callback(on_sample, indirect=False)
        self._keep.append(self._session.declare_subscriber(self._key(topic.name), handler))

    def serve_header(self, header: wire.Header) -> None:
        """Answer queries for the configuration of the header's role with `header`."""
        key = self._key(f"header/{header.role}")
        payload = header.SerializeToString()

        def reply(query: Any) -> None:
            with query:
                query.reply(key, payload)

        self._keep.append(self._session.declare_queryable(key, reply))

    def headers(self, roles: Iterable[str], timeout_s: float, stop: threading.Event) -> dict[str, wire.Header]:
        """The configurations of those `roles` that answer within `timeout_s` and before `stop` is set, by role."""
        found: dict[str, wire.Header] = {}
        until_s = time.monotonic() + timeout_s
        missing = set(roles)
        while missing and time.monotonic() < until_s and not stop.is_set():
            for reply in self._session.get(self._key("header/*"), timeout=0.5):
                if reply.ok is not None:
                    header = parsed(wire.Header, reply.ok.payload.to_bytes(), "header")
                    found[header.role] = header
                    missing.discard(header.role)
            if missing:
                time.sleep(0.02)
        return found

    def announce(self) -> None:
        """Announce that this role is ready: its subscriptions are in place and its kernels are compiled."""
        self._keep.append(self._session.liveliness().declare_token(self._key(f"alive/{self._role}")))

    def claim(self) -> tuple[str, Callable[[], set[str]]]:
        """Announce that this process wants its role. Returns its claim, and a function that returns the claims of others."""
        mine = uuid.uuid4().hex
        liveliness = self._session.liveliness()
        self._keep.append(liveliness.declare_token(self._key(f"claim/{self._role}/{mine}")))
        listener = zenoh.handlers.Callback(self._on_claim, indirect=False)
        self._keep.append(liveliness.declare_subscriber(self._key(f"claim/{self._role}/*"), listener, history=True))

        def others() -> set[str]:
            with self._alive_changed:
                return self._claims - {mine}

        return mine, others

    def alive(self, role: str) -> bool:
        """Whether `role` is on the bus now."""
        with self._alive_changed:
            return role in self._alive

    def wait_for(self, roles: Iterable[str], timeout_s: float) -> set[str]:
        """Wait until all `roles` are on the bus, and return the roles that are missing after `timeout_s`."""
        wanted = set(roles)
        with self._alive_changed:
            self._alive_changed.wait_for(lambda: wanted <= self._alive, timeout_s)
            return wanted - self._alive

    def wait_until_alone(self, timeout_s: float) -> None:
        """Wait until no other role is on the bus, at most `timeout_s`."""
        with self._alive_changed:
            self._alive_changed.wait_for(lambda: self._alive <= {self._role}, timeout_s)


def _brief(error: Exception) -> str:
    text = str(error).splitlines()[0]
    return text if len(text) < 90 else text[:87] + "..."
