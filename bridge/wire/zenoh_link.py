"""The bus: one Zenoh session of one process, on an explicit endpoint, without scouting.

The plant listens. All other processes connect to it as clients, and it relays their messages. Receiving threads only copy bytes
into bounded queues: publishing from a callback can deadlock.
"""

import contextlib
import ctypes
import functools
import os
import re
import socket
import struct
import sys
import threading
import time
import uuid
from collections.abc import Callable, Iterable
from types import TracebackType
from typing import Any, Self

from bridge.faults import Fault
from bridge.processes import this_process
from bridge.threads import repeat
from bridge.wire import certificates, loopback_users
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.bus_config import BusConfig, is_free, is_loopback
from bridge.wire.inbox import Inbox, Received
from bridge.wire.payloads import largest_bytes, parsed
from bridge.wire.session import DIAL_S, rig_security, role_security, session_config, zenoh
from bridge.wire.topics import Topic

__all__ = ["Bus", "BusConfig", "Inbox", "Received"]

# Duration of one attempt to dial without a password. Longer: a rig that needs one is dialled in vain for longer, every 20 ms.
_WITHOUT_PASSWORD_S = 0.2
_FREE_S = 0.02  # interval at which an endpoint without a listener and without a password is looked at
# Interval of looking for new connections; those without a handshake are closed after 1 s. Longer: some are closed before, with a
# wait of 7 ms each. Shorter: 0.1 ms of this process each time.
_LINGER_S = 0.3
_READS_S = 0.5  # time in which a running rig reads the first bytes of a connection, even on a busy computer
_NO_PROTOCOL = b"\x08\x00" + b"\xff" * 8  # invalid as Zenoh and as TLS: a rig that runs ends the connection
_AT_ONCE = struct.pack("ii", 0, 0)  # value of SO_LINGER: off
_SOURCE_LINE = re.compile(r" at /\S+\.rs:\d+\.?")  # a line of Zenoh's source, at the end of each of its errors
_LIBC = ctypes.CDLL(None)
_ROLES = frozenset({"plant", "controller", "recorder"})  # roles that announce themselves by a liveliness token
_MOST_CLAIMS = 64  # most claims that are stored; more are a flood, and a controller yields to a single rival already


_of_thread = threading.local()


def _keep_thread_state() -> None:
    """Keep Python's state of the present thread of Zenoh until the thread ends.

    Otherwise Python creates the state for every callback, which costs a page fault for each message.
    """
    if not hasattr(_of_thread, "kept"):
        ctypes.pythonapi.PyGILState_Ensure()
        _of_thread.kept = True


def _close_at_once() -> None:
    """Make this process close its links without a wait for unsent data. Raises OSError without a free file.

    Zenoh sets SO_LINGER: if the other process does not read, closing a link takes 7 to 40 ms, on a thread that others wait for
    (zenoh issues 1101, 2350). Unsent data of a closed link are still sent.
    """
    for name in os.listdir("/proc/self/fd"):  # has no effect on files that are not sockets
        _LIBC.setsockopt(int(name), socket.SOL_SOCKET, socket.SO_LINGER, _AT_ONCE, len(_AT_ONCE))


def _on_link(_event: zenoh.TransportEvent) -> None:
    """Let a new link be closed at once; without a free file, the thread `links` of a rig does it later."""
    with contextlib.suppress(OSError):
        _close_at_once()


@functools.cache
def _warn(text: str) -> None:
    """Print a warning on stderr, once for each text: a viewer opens a session again after each absence of the rig."""
    print(f"stickslip: warning: {text}", file=sys.stderr, flush=True)


def _listening(config: BusConfig, lockstep: bool) -> zenoh.Session:
    security = rig_security(config)
    try:
        session = zenoh.open(session_config(config, hub=True, lockstep=lockstep, security=security))
    except zenoh.ZError as error:
        cause = _SOURCE_LINE.sub("", str(error).splitlines()[0])
        line = f"{config.endpoint}: cannot listen on it: must be a free port and an address of this computer ({cause})"
        raise Fault("ENDPOINT_BUSY", f"{line}; end the process that holds it, or choose another --endpoint") from None
    return session


def _dialled(
    config: BusConfig, role: str, lockstep: bool, stop: threading.Event, fixed_s: float | None
) -> zenoh.Session:
    """Dial the rig for `fixed_s`, which commands without --wait give, else for `config.wait_s`."""
    patience_s = config.wait_s if fixed_s is None else fixed_s
    until_s = time.monotonic() + patience_s
    while not stop.is_set():
        # Looked at before the password is read: a rig makes it before it listens, and counts each attempt without it as refused.
        free = is_free(config.endpoint)
        security = role_security(config, role)
        if security or not free:
            dial_s = min(DIAL_S if security else _WITHOUT_PASSWORD_S, patience_s)
            with contextlib.suppress(zenoh.ZError):
                return zenoh.open(session_config(config, False, lockstep, dial_s, security))
        else:
            stop.wait(_FREE_S)
        if time.monotonic() > until_s:
            line = f"{config.endpoint}: no plant answered within {patience_s:g} s"
            more = "; a first start compiles before it answers" + (": --wait S waits longer" if fixed_s is None else "")
            raise Fault("NO_PEER", f"{line}; {_remedy(config)}{more}")
    raise Fault("NO_PEER", f"{config.endpoint}: no plant answered before the stop")


# A client learns nothing of the cause of a refusal: Zenoh closes the connection.
REFUSES = (
    "a process listens there: if it is a rig, it refused this session (another password or authority), and its event REFUSED "
    "gives the cause"
)


def reads(config: BusConfig) -> bool | None:
    """Whether the process that listens at an endpoint reads; None without one. False: frozen, or without processor time.

    Call it after a missing answer. A running rig ends a connection whose first bytes do not follow its protocol.
    """
    host, _, port = config.endpoint.partition("/")[2].rpartition(":")
    listens = None
    try:
        with socket.create_connection((host.strip("[]"), int(port)), _READS_S) as link:
            listens = True
            link.sendall(_NO_PROTOCOL)
            link.recv(64)
    except TimeoutError:
        return False
    except OSError:
        pass
    return listens


def _remedy(config: BusConfig) -> str:
    start = "start `stickslip plant` with this --endpoint"
    if config.encrypted:
        return (
            f"{start}, and check the certificates: both sides need the same authority, and the rig's must name its host"
        )
    is_held = is_loopback(config.endpoint) and not is_free(config.endpoint)
    return loopback_users.absence(config.endpoint) or (REFUSES if is_held else start)


class Bus:
    """The session of one role. Use it as a context manager: an unclosed session hangs the process at its end."""

    def __init__(
        self,
        config: BusConfig,
        role: str,
        lockstep: bool,
        stop: threading.Event | None = None,
        patience_s: float | None = None,
    ) -> None:
        """Listen as the plant; any other role dials the plant for `patience_s`, else `config.wait_s`, or until `stop` is set.

        Roles other than controller, recorder and operator are viewers, which may only listen.

        Raises Fault ENDPOINT_BUSY, NO_PEER, NOT_SECURE.
        """
        self._config = config
        self._role = role
        self._lockstep = lockstep
        self._keep: list[Any] = []
        self._token: Any = None
        self._alive: set[str] = set()
        self._announced: dict[str, int] = {}
        self._claims: set[str] = set()
        self._alive_changed = threading.Condition()
        zenoh.init_log_from_env_or("off")
        credentials = certificates.RIG if role == "plant" else role if role in loopback_users.ROLES else "viewer"
        place = certificates.folder(config.certificates)
        self._ends = certificates.ends_of(credentials, place) if config.encrypted else []
        self._session = (
            _listening(config, lockstep)
            if role == "plant"
            else _dialled(
                config,
                credentials,
                lockstep,
                stop or threading.Event(),
                patience_s,
            )
        )
        if role != "plant" and (text := self.expiring()):
            _warn(text)
        self._over = threading.Event()
        if role == "plant":
            has_passwords = not (config.encrypted or config.insecure)
            self._users = loopback_users.KeptUsers(config.endpoint) if has_passwords else None
            tend = (self._tend, _LINGER_S, self._over, _warn)
            threading.Thread(target=repeat, args=tend, name="links", daemon=True).start()
        # called in a Python thread, because it visits every open file of this process
        self._keep.append(self._session.info.declare_transport_events_listener(_on_link, history=True))
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
        self._over.set()
        with contextlib.suppress(zenoh.ZError):
            self._session.close()

    def _tend(self) -> None:
        """Keep the passwords; let connections that send nothing be closed at once: 300 of them stopped all links for 0.25 s."""
        _close_at_once()
        if self._users is not None:
            self._users.keep()

    def expiring(self) -> str:
        """The certificates of this session that end within 30 days, as text; empty if none does."""
        return certificates.expiring(self._ends)

    def _key(self, name: str) -> str:
        return f"{self._config.prefix}/{name}"

    def _on_alive(self, sample: Any) -> None:
        role = str(sample.key_expr).rsplit("/", 1)[-1]
        if role in _ROLES:  # no process waits for other roles
            self._update(self._alive, role, sample)

    def _on_claim(self, sample: Any) -> None:
        claim = str(sample.key_expr).rsplit("/", 1)[-1]
        if len(self._claims) < _MOST_CLAIMS or claim in self._claims:
            self._update(self._claims, claim, sample)

    def _update(self, names: set[str], name: str, sample: Any) -> None:
        """Add the name of a token to `names`, or remove it when the token was withdrawn."""
        with self._alive_changed:
            if sample.kind == zenoh.SampleKind.PUT:
                names.add(name)
                self._announced[name] = self._announced.get(name, 0) + 1
            else:
                names.discard(name)
            self._alive_changed.notify_all()

    def publisher(self, topic: Topic) -> Callable[[bytes], None]:
        """A function that sends bytes on `topic`.

        Zenoh sends a message at once if its queue is empty, and otherwise packs messages together: 16 packets hold about 1600
        blocks. With `express` each message fills a packet, and a receiver that stalls for 17 ms loses blocks. In real time a
        message that cannot be sent is dropped; in lockstep the call waits.
        """
        block = zenoh.CongestionControl.BLOCK
        declared = self._session.declare_publisher(
            self._key(topic.name),
            encoding=zenoh.Encoding.APPLICATION_PROTOBUF,
            congestion_control=block if self._lockstep else zenoh.CongestionControl.DROP,
        )
        self._keep.append(declared)
        return declared.put

    def listen(self, topic: Topic, receive: Callable[[Received], None]) -> None:
        """Call `receive` for every message of `topic` in a receiving thread; it must only store the message."""
        most = largest_bytes(topic.message)

        def on_sample(sample: Any) -> None:
            _keep_thread_state()
            payload = sample.payload.to_bytes()
            if len(payload) > most:  # still long enough to be refused for its length
                payload = payload[: most + 1]
            receive(Received(topic, payload, time.perf_counter_ns()))

        handler = zenoh.handlers.Callback(on_sample, indirect=False)
        self._keep.append(self._session.declare_subscriber(self._key(topic.name), handler))

    def serve_header(self, header: wire.Header) -> None:
        """Answer queries for the configuration of the header's role with `header` and the identity of this process."""
        key = self._key(f"header/{header.role}")
        answer = wire.Header()
        answer.CopyFrom(header)
        answer.process = this_process()
        payload = answer.SerializeToString()

        def reply(query: Any) -> None:
            with query:
                query.reply(key, payload)

        self._keep.append(self._session.declare_queryable(key, reply))

    def headers(self, roles: Iterable[str], timeout_s: float, stop: threading.Event) -> dict[str, wire.Header]:
        """The configurations of those `roles` that answer within `timeout_s` and before `stop` is set, by role."""
        answers: dict[str, wire.Header] = {}
        until_s = time.monotonic() + timeout_s
        missing = set(roles)
        while missing and time.monotonic() < until_s and not stop.is_set():
            for reply in self._session.get(self._key("header/*"), timeout=0.5):
                header = _header(reply)
                if header is not None and header.role in missing:
                    answers[header.role] = header
                    missing.discard(header.role)
            if missing:
                time.sleep(0.02)
        return answers

    def announce(self) -> None:
        """Announce that this role is ready: its subscriptions are in place and its kernels are compiled."""
        self._token = self._session.liveliness().declare_token(self._key(f"alive/{self._role}"))

    def withdraw(self) -> None:
        """Withdraw the announcement: this role ends, but its session still relays messages of the others."""
        if self._token is not None:
            self._token.undeclare()
            self._token = None

    def claim(self) -> tuple[str, Callable[[], set[str]]]:
        """Claim the role for this process. Returns the claim, and a function that returns the claims of others."""
        own_claim = uuid.uuid4().hex
        liveliness = self._session.liveliness()
        self._keep.append(liveliness.declare_token(self._key(f"claim/{self._role}/{own_claim}")))
        listener = zenoh.handlers.Callback(self._on_claim, indirect=False)
        self._keep.append(liveliness.declare_subscriber(self._key(f"claim/{self._role}/*"), listener, history=True))

        def others() -> set[str]:
            with self._alive_changed:
                return self._claims - {own_claim}

        return own_claim, others

    def alive(self, role: str) -> bool:
        """Whether `role` is on the bus now."""
        with self._alive_changed:
            return role in self._alive

    def came(self, role: str) -> int:
        """Number of announcements of `role`; above 1, the role or the link to it was lost in between."""
        with self._alive_changed:
            return self._announced.get(role, 0)

    def linked(self) -> bool:
        """Whether this session, which dialled, has a link to the rig."""
        return bool(self._session.info.peers_zid() or self._session.info.routers_zid())

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


def _header(reply: Any) -> wire.Header | None:
    """The header in a reply; None if it is invalid, or if its role is not the role of the key."""
    if reply.ok is None:
        return None
    with contextlib.suppress(Fault):
        header = parsed(wire.Header, reply.ok.payload.to_bytes(), "header")
        if str(reply.ok.key_expr).endswith(f"/header/{header.role}"):
            return header
    return None
