"""Loops that take turns on a simulated clock: one runs at a time, and time passes only while all of them wait.

So the loops of the processes, which sleep and wait for messages, run unchanged and always in the same order. Messages arrive at
once and in order, unless the link of sender or receiver is down.
"""

import threading
from collections.abc import Callable, Generator, Iterable
from functools import partial

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.clock import Wait, time
from bridge.wire.inbox import Received
from bridge.wire.topics import Topic

Receive = Callable[[Received], None]


class _Left(BaseException):
    """Raised inside a killed player where it waits, to end its loop."""


class Player:
    """The loop of one process; `name` is its role."""

    def __init__(self, name: str, loop: Generator[Wait]) -> None:
        self.name = name
        self.over = False
        self.failed: BaseException | None = None
        self.wakes_ns = 0  # time at which the loop continues
        self.hears = False  # a message for this role wakes the loop before `wakes_ns`
        self.frozen_until_ns = 0
        self._loop = loop

    def turn(self, now_ns: int) -> None:
        """Let the loop run until it waits again or ends."""
        self.hears = False
        try:
            wait = next(self._loop)
        except StopIteration:
            self.over = True
        except BaseException as error:  # the stage passes it to `on_failure`
            self.over, self.failed = True, error
        else:
            # at least 1 ns for a positive time: a loop that waits for a deadline would otherwise never reach it
            self.wakes_ns = now_ns + max(round(wait.for_s * 1e9), 1 if wait.for_s > 0.0 else 0)
            self.hears = wait.hears

    def leave(self) -> None:
        """End the loop at once, as a signal ends a process: its remaining steps wait for nothing."""
        while not self.over:
            try:
                self._loop.throw(_Left)
            except (_Left, StopIteration):
                self.over = True

    @property
    def next_ns(self) -> int:
        """Time at which the loop continues, unless a message wakes it."""
        return max(self.wakes_ns, self.frozen_until_ns)


class Stage:
    """The clock and the players. `play` runs them."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.players: list[Player] = []
        self._cues: list[tuple[int, Callable[[], None]]] = []

    def enter(self, player: Player) -> Player:
        """Add a player; its first turn is due at the present time."""
        player.wakes_ns = self.now_ns
        self.players.append(player)
        return player

    def cue(self, t_ns: int, act: Callable[[], None]) -> None:
        """Call `act` at a simulated time, before the turn of any player."""
        self._cues.append((t_ns, act))
        self._cues.sort(key=lambda cue: cue[0])

    def _pass(self, for_s: float) -> None:
        self.now_ns += round(for_s * 1e9)

    def heard(self, name: str) -> None:
        """Wake a player that waits for the message that has arrived."""
        for player in self.players:
            if player.name == name and player.hears:
                player.wakes_ns = min(player.wakes_ns, self.now_ns)

    def play(self, until: Callable[[], bool], at_end: Callable[[], None], on_failure: Callable[[Player], None]) -> None:
        """Let the players take turns until `until`, called before each turn, returns True or all have ended.

        `at_end` is called before the remaining players are removed, `on_failure` with a player that ended with an error.
        """
        with time.simulated(lambda: self.now_ns, self._pass):
            try:
                while not until() and (active := [player for player in self.players if not player.over]):
                    following = min(active, key=lambda player: player.next_ns)
                    if self._cues and self._cues[0][0] <= following.next_ns:
                        t_ns, act = self._cues.pop(0)
                        self.now_ns = max(self.now_ns, t_ns)
                        act()
                        continue
                    self.now_ns = max(self.now_ns, following.next_ns)
                    following.turn(self.now_ns)
                    if following.failed is not None:
                        on_failure(following)
            finally:
                at_end()
                for player in self.players:
                    player.leave()


class Hub:
    """State that all sessions share: listeners, present roles, and roles whose link is down."""

    def __init__(self, stage: Stage) -> None:
        self.stage = stage
        self.present: set[str] = set()  # roles on the bus
        self.came: dict[str, int] = {}  # by role: how often it has joined the bus
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
        """Take the link of a role down: others no longer see the role on the bus."""
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
        return partial(self._hub.put, self._role, topic)

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
        """How often a role has joined the bus: a restart is noticed by it."""
        return self._hub.came.get(role, 0)

    def expiring(self) -> str:
        """Empty: a simulated bus has no certificates."""
        return ""

    def linked(self) -> bool:
        """Whether the link to the rig is up."""
        return not self._hub.down & {self._role, "plant"}

    def withdraw(self) -> None:
        """Leave the bus in the eyes of the others; messages of this role still arrive."""
        self._hub.present.discard(self._role)
