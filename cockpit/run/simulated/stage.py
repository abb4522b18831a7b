"""Threads that take turns on a simulated clock: one runs at a time, and time passes only where all of them wait.

So the loops of the processes, which sleep and wait for messages, run as they are, always in the same order.
"""

import threading
from collections.abc import Callable

from bridge.wire.clock import time
from bridge.wire.inbox import Inbox, Received


class _Left(BaseException):
    """Ends a player that was killed, from inside, wherever it waits."""


class Player:
    """One thread of the play: the loop of one process.

    Args:
        name: of the process.
        work: its loop.

    """

    def __init__(self, name: str, work: Callable[[], object]) -> None:
        self.name = name
        self.over = False
        self.failed: BaseException | None = None
        self.wakes_ns = 0  # when it goes on
        self.hears = False  # whether a message wakes it before
        self.frozen_until_ns = 0
        self._killed = False
        self._work = work
        self._go, self._done = threading.Semaphore(0), threading.Semaphore(0)
        self._thread = threading.Thread(target=self._play, name=name, daemon=True)
        self._thread.start()

    def _play(self) -> None:
        self._go.acquire()
        try:
            if not self._killed:
                self._work()
        except _Left:
            pass
        except BaseException as error:  # raised again by who looks at `failed`
            self.failed = error
        self.over = True
        self._done.release()

    def turn(self) -> None:
        """Let it go on until it waits again, or is over; called by the stage."""
        self._go.release()
        self._done.acquire()

    def pause(self) -> None:
        """Give the turn back; called by the player itself."""
        if not self._killed:  # else it is on its way out, and waits for nothing
            self._done.release()
            self._go.acquire()
        if self._killed:
            raise _Left

    def leave(self) -> None:
        """Let it end where it waits."""
        self._killed = True
        self.turn()

    @property
    def next_ns(self) -> int:
        """When it goes on, unless a message wakes it."""
        return max(self.wakes_ns, self.frozen_until_ns)


class WaitingInbox(Inbox):
    """An inbox whose `get` waits in simulated time."""

    def __init__(self, limit: int, stage: "Stage") -> None:
        Inbox.__init__(self, limit)
        self._stage = stage

    def get(self, timeout_s: float) -> Received | None:
        """The oldest message, or None when none came within `timeout_s`."""
        received = self.get_nowait()
        if received is None:
            self._stage.wait(timeout_s, hears=True)
            received = self.get_nowait()
        return received


class Stage:
    """The clock and the players. `play` runs them in this thread's time."""

    def __init__(self) -> None:
        self.now_ns = 0
        self.players: list[Player] = []
        self._on_stage: Player | None = None
        self._cues: list[tuple[int, Callable[[], None]]] = []

    def enter(self, player: Player) -> Player:
        """Add a player, whose first turn is now."""
        player.wakes_ns = self.now_ns
        self.players.append(player)
        return player

    def cue(self, t_ns: int, act: Callable[[], None]) -> None:
        """Do something at a time, before anybody's turn."""
        self._cues.append((t_ns, act))
        self._cues.sort(key=lambda cue: cue[0])

    def wait(self, for_s: float, hears: bool = False) -> None:
        """Let simulated time pass; called by the player whose turn it is.

        Args:
            for_s: how long.
            hears: a message for the player ends it before.

        """
        player = self._on_stage
        if player is None:  # nobody plays: a test or a warm-up
            self.now_ns += round(for_s * 1e9)
            return
        # a time that is not over takes a nanosecond at least, or who waits for its end would wait for ever
        passes_ns = max(round(for_s * 1e9), 1 if for_s > 0.0 else 0)
        player.wakes_ns, player.hears = self.now_ns + passes_ns, hears
        player.pause()

    def heard(self, name: str) -> None:
        """A message came for a player."""
        for player in self.players:
            if player.name == name and player.hears:
                player.wakes_ns = min(player.wakes_ns, self.now_ns)

    def remove(self, player: Player) -> None:
        """End a player at once, as a signal ends a process."""
        if not player.over:
            before, self._on_stage = self._on_stage, player
            player.leave()
            self._on_stage = before

    def play(self, until: Callable[[], bool], at_end: Callable[[], None], on_failure: Callable[[Player], None]) -> None:
        """Let everybody take turns until `until` says so, or all are over.

        Args:
            until: asked before each turn.
            at_end: called before those are removed that are not over.
            on_failure: called with a player that ended in an error.

        """
        with time.simulated(lambda: self.now_ns, self.wait):
            try:
                while not until() and (there := [player for player in self.players if not player.over]):
                    following = min(there, key=lambda player: player.next_ns)
                    if self._cues and self._cues[0][0] <= following.next_ns:
                        t_ns, act = self._cues.pop(0)
                        self.now_ns = max(self.now_ns, t_ns)
                        act()
                        continue
                    self.now_ns = max(self.now_ns, following.next_ns)
                    following.hears = False
                    self._on_stage = following
                    following.turn()
                    self._on_stage = None
                    if following.failed is not None:
                        on_failure(following)
            finally:
                at_end()
                for player in self.players:
                    self.remove(player)
