"""Threads that take turns on a simulated clock: one runs at a time, and time passes only while all of them wait.

So the loops of the processes, which sleep and wait for messages, run unchanged and always in the same order.
"""

import threading
from collections.abc import Callable

from bridge.wire.clock import time
from bridge.wire.inbox import Inbox, Received


class _Left(BaseException):
    """Raised inside a killed player where it waits, to end its thread."""


class Player:
    """A thread with the loop of one process.

    Args:
        name: role of the process.
        work: loop of the process.

    """

    def __init__(self, name: str, work: Callable[[], object]) -> None:
        self.name = name
        self.over = False
        self.failed: BaseException | None = None
        self.wakes_ns = 0  # time at which the thread continues
        self.hears = False  # whether a message wakes the thread earlier
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
        except BaseException as error:  # the stage passes it to `on_failure`
            self.failed = error
        self.over = True
        self._done.release()

    def turn(self) -> None:
        """Let the thread run until it waits again or ends; called by the stage."""
        self._go.release()
        self._done.acquire()

    def pause(self) -> None:
        """Give the turn back; called by the player itself."""
        if not self._killed:  # a killed player ends without another turn
            self._done.release()
            self._go.acquire()
        if self._killed:
            raise _Left

    def leave(self) -> None:
        """End the thread at its wait."""
        self._killed = True
        self.turn()

    @property
    def next_ns(self) -> int:
        """Time at which the thread continues, unless a message wakes it."""
        return max(self.wakes_ns, self.frozen_until_ns)


class WaitingInbox(Inbox):
    """An inbox whose `get` waits in simulated time."""

    def __init__(self, limit: int, stage: "Stage") -> None:
        Inbox.__init__(self, limit)
        self._stage = stage

    def get(self, timeout_s: float) -> Received | None:
        """The oldest message, or None if no message arrived within `timeout_s`."""
        received = self.get_nowait()
        if received is None:
            self._stage.wait(timeout_s, hears=True)
            received = self.get_nowait()
        return received


class Stage:
    """The clock and the players. `play` runs them from the calling thread."""

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
        """Call `act` at a simulated time, before the turn of any player."""
        self._cues.append((t_ns, act))
        self._cues.sort(key=lambda cue: cue[0])

    def wait(self, for_s: float, hears: bool = False) -> None:
        """Let simulated time pass; called by the player whose turn it is.

        Args:
            for_s: duration.
            hears: a message for the player ends the wait early.

        """
        player = self._on_stage
        if player is None:  # no player has the turn: a test or a warm-up
            self.now_ns += round(for_s * 1e9)
            return
        # at least 1 ns for a positive time: a loop that waits for a deadline would otherwise never reach it
        passes_ns = max(round(for_s * 1e9), 1 if for_s > 0.0 else 0)
        player.wakes_ns, player.hears = self.now_ns + passes_ns, hears
        player.pause()

    def heard(self, name: str) -> None:
        """Wake a player that waits for the message that has arrived."""
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
        """Let the players take turns until `until` returns True or all have ended.

        Args:
            until: called before each turn.
            at_end: called before the remaining players are removed.
            on_failure: called with a player that ended with an error.

        """
        with time.simulated(lambda: self.now_ns, self.wait):
            try:
                while not until() and (active := [player for player in self.players if not player.over]):
                    following = min(active, key=lambda player: player.next_ns)
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
