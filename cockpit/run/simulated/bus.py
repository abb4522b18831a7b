"""The bus of a simulated run: messages arrive at once and in order, unless their sender or receiver stands still for too long."""

import threading
from collections.abc import Callable, Iterable

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.inbox import Received
from bridge.wire.topics import Topic
from cockpit.run.simulated.stage import Stage

Receive = Callable[[Received], None]


class Hub:
    """What all sessions share: who listens, who is there, and whose link is down."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.there: set[str] = set()
        self.came: dict[str, int] = {}
        self.down: set[str] = set()  # roles without a link
        self._listeners: dict[str, list[tuple[str, Receive]]] = {}

    def listen(self, role: str, topic: Topic, receive: Receive) -> None:
        """Hear a topic as a role."""
        self._listeners.setdefault(topic.name, []).append((role, receive))

    def put(self, role: str, topic: Topic, payload: bytes) -> None:
        """Say something as a role; without a link nobody hears it."""
        if role in self.down:
            return
        received = Received(topic, payload, self.stage.now_ns)
        for listener, receive in self._listeners.get(topic.name, ()):
            if listener not in self.down:
                receive(received)
                self.stage.heard(listener)

    def announce(self, role: str) -> None:
        """A role is there."""
        self.down.discard(role)
        self.there.add(role)
        self.came[role] = self.came.get(role, 0) + 1

    def lose(self, role: str) -> None:
        """The link of a role goes down, and its announcement with it."""
        self.down.add(role)
        self.there.discard(role)

    def forget(self, role: str) -> None:
        """A process is gone with all its subscriptions."""
        self.lose(role)
        for name, listeners in self._listeners.items():
            self._listeners[name] = [one for one in listeners if one[0] != role]


class Session:
    """The session of one role: what `bridge.wire.zenoh_link.Bus` is to the loops of the processes."""

    def __init__(self, hub: Hub, role: str) -> None:
        self._hub, self._role = hub, role

    def publisher(self, topic: Topic) -> Callable[[bytes], None]:
        """A function that sends bytes on a topic."""

        def put(payload: bytes) -> None:
            self._hub.put(self._role, topic, payload)

        return put

    def listen(self, topic: Topic, receive: Receive) -> None:
        """Call `receive` for every message of a topic."""
        self._hub.listen(self._role, topic, receive)

    def headers(self, _roles: Iterable[str], _timeout_s: float, _stop: threading.Event) -> dict[str, wire.Header]:
        """Nothing: rig and controller of a simulated run come of one scenario, and need not tell each other what they are."""
        return {}

    def alive(self, role: str) -> bool:
        """Whether a role is on the bus, as this one sees it: nobody is, without a link of its own."""
        return self._role not in self._hub.down and role in self._hub.there

    def came(self, role: str) -> int:
        """How many times a role has announced itself."""
        return self._hub.came.get(role, 0)

    def linked(self) -> bool:
        """Whether the link to the rig stands."""
        return not self._hub.down & {self._role, "plant"}

    def withdraw(self) -> None:
        """Take the announcement back; what this role says is still heard."""
        self._hub.there.discard(self._role)
