"""The bus of a simulated run: messages arrive at once and in order, unless the link of sender or receiver is down."""

import threading
from collections.abc import Callable, Iterable

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.inbox import Received
from bridge.wire.topics import Topic
from cockpit.run.simulated.stage import Stage

Receive = Callable[[Received], None]


class Hub:
    """State that all sessions share: listeners, present roles, and roles whose link is down."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.present: set[str] = set()  # roles on the bus
        self.came: dict[str, int] = {}  # number of announcements by role
        self.down: set[str] = set()  # roles without a link
        self._listeners: dict[str, list[tuple[str, Receive]]] = {}

    def listen(self, role: str, topic: Topic, receive: Receive) -> None:
        """Subscribe to a topic as a role."""
        self._listeners.setdefault(topic.name, []).append((role, receive))

    def put(self, role: str, topic: Topic, payload: bytes) -> None:
        """Publish a payload as a role; it is lost if the role's link is down."""
        if role in self.down:
            return
        received = Received(topic, payload, self.stage.now_ns)
        for listener, receive in self._listeners.get(topic.name, ()):
            if listener not in self.down:
                receive(received)
                self.stage.heard(listener)

    def announce(self, role: str) -> None:
        """Let a role join the bus."""
        self.down.discard(role)
        self.present.add(role)
        self.came[role] = self.came.get(role, 0) + 1

    def lose(self, role: str) -> None:
        """Take the link of a role down, and with it its announcement."""
        self.down.add(role)
        self.present.discard(role)

    def forget(self, role: str) -> None:
        """End the subscriptions of a role, as its process has ended."""
        self.lose(role)
        for name, listeners in self._listeners.items():
            self._listeners[name] = [listener for listener in listeners if listener[0] != role]


class Session:
    """The session of one role; replaces `bridge.wire.zenoh_link.Bus` in the loops of the processes."""

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
        """Empty: rig and controller of a simulated run come from one scenario, and their headers need no comparison."""
        return {}

    def alive(self, role: str) -> bool:
        """Whether this role sees another role on the bus; always False while its link is down."""
        return self._role not in self._hub.down and role in self._hub.present

    def came(self, role: str) -> int:
        """Number of announcements of a role."""
        return self._hub.came.get(role, 0)

    def linked(self) -> bool:
        """Whether the link to the rig is up."""
        return not self._hub.down & {self._role, "plant"}

    def withdraw(self) -> None:
        """Withdraw the announcement; messages of this role still arrive."""
        self._hub.present.discard(self._role)
