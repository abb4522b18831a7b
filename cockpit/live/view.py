"""State of a rig for display: new buckets, events and captures, the current words and figures, and one sentence."""

import collections
import contextlib
import time
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from bridge.arrays import Records
from bridge.faults import Fault
from bridge.log.metadata import value_at
from bridge.log.screen import Screen
from bridge.log.watches.event_watch import CORE_PAUSE, PAUSE
from bridge.plain import plain
from bridge.units import counted
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.complaints import WINDOW, Complaints
from bridge.wire.event_codes import FAILURE, SEVERITIES, TRIPS, WEAK_REASONS, event_code, harms
from bridge.wire.messages import APPLIED, TRACE
from bridge.wire.payloads import other_rig, parsed
from bridge.wire.words import OUTSIDE, help_of, word_of
from bridge.wire.zenoh_link import Received
from cockpit.figures.signals import SIGNALS, WORD_SIGNALS, stroke_limits
from cockpit.live.buckets import Bucketing, Buckets, SensorTables, Tally, block_numbers, table_of
from cockpit.live.listener import Source
from cockpit.live.trigger import Capture, Scope

SILENT_S = 0.5  # age of a message from which its values are hidden. Longer: old values are shown as current
_AT_ONCE = 1 << 13  # most messages taken per step; more than the queue holds
_FAR = 12_000  # buckets without a block (one minute) after which a new run is assumed
_EVENTS_KEPT = 200  # events kept for newly opened pages
_EVENTS_AT_ONCE = 50  # events listed per step; further events are only counted
_LONGEST_TEXT = 500  # characters of an event's text; the rest is cut off
_SLIPS_S = 10.0  # window for the count of recent slips
WAITING, LIVE, SILENT, LEFT, ENDED = "waiting", "live", "silent", "left", "ended"
GOOD, LOOK, BAD, OFF = "good", "look", "bad", "off"


class EventRow(NamedTuple):
    """One event for display."""

    t_s: float  # time of the run
    at: str  # local time of day
    source: str
    code: str
    letter: str  # severity by NAMUR NE 107; empty for an event without severity
    weight: str  # meaning of the letter
    text: str
    help: str


class ViewUpdate(NamedTuple):
    """News since the last step."""

    new_run: bool  # a new run began: discard the display of the earlier one
    buckets: Buckets | None
    capture: Capture | None
    events: list[EventRow]
    tables: Mapping[str, Records]  # new messages by topic: sensors, trace, applied; topics without any are absent


class Answer(NamedTuple):
    """State of the rig in one sentence."""

    level: str  # GOOD, LOOK, BAD; OFF: no rig to report on
    text: str


class _Run:
    """State that starts with each run."""

    def __init__(self, block_ns: int, dtype: np.dtype[Any]) -> None:
        self.dtype = dtype  # layout of its blocks
        self.buckets = Bucketing(block_ns)
        self.scope = Scope(block_ns)
        self.tally = Tally()
        self.slips: collections.deque[tuple[float, int]] = collections.deque()  # time [s] and count, of the last 10 s
        self.newest = {"sensors": -1, "trace": -1, "applied": -1}  # newest block number by topic


class View:
    """Follows a source of messages from the endpoint `where`, step by step; `clock` returns the time [s]."""

    def __init__(self, source: Source, where: str, clock: Callable[[], float] = time.monotonic) -> None:
        self._source, self._where, self._clock = source, where, clock
        self.unreadable = 0  # reports of malformed messages or unauthenticated clients, at most one per second and kind
        self.pauses = 0  # stalls of the computer reported by the recorder; counted, not listed as events
        self.run: _Run | None = None
        self.events: collections.deque[EventRow] = collections.deque(maxlen=_EVENTS_KEPT)
        self.capture: Capture | None = None
        self._sensors = SensorTables()
        self._screen = Screen(Complaints(self._count_unreadable, clock))
        self._heard_s: dict[str, float] = {}  # time of the newest message by topic
        self._newest: dict[str, Records] = {}
        self._taken: dict[str, Records] = {}  # new messages of this step by topic
        self._ended_at_s: float | None = None  # time of the run at the rig's END
        self._began_s = clock()

    def _count_unreadable(self, _code: str, _text: str) -> None:
        self.unreadable += 1

    def step(self) -> ViewUpdate:
        """Process all queued messages."""
        waiting: dict[str, list[bytes]] = {"sensors": [], "trace": [], "applied": []}
        events: list[Received] = []
        for _ in range(_AT_ONCE):
            received = self._source.inbox.get()
            if received is None:
                break
            for message in self._screen.passed(received):
                if message.topic.name in waiting:
                    waiting[message.topic.name].append(message.payload)
                else:
                    events.append(message)
        self._taken = {}
        new_run = self._take_blocks(waiting["sensors"])
        self._take("trace", waiting["trace"])
        self._take("applied", waiting["applied"])
        run = self.run
        capture = run.scope.ready() if run is not None else None
        self.capture = capture or (None if new_run else self.capture)
        buckets = run.buckets.made(self._taken.get("sensors")) if run is not None else None
        return ViewUpdate(new_run, buckets, capture, self._take_events(events), self._taken)

    def take_now(self) -> None:
        """Trigger the scope by hand."""
        if self.run is not None:
            self.run.scope.take_now()

    def _take_blocks(self, payloads: list[bytes]) -> bool:
        """Add blocks; True if they start a new run."""
        table = self._sensors.of(payloads)
        if table is None:
            return False
        numbers = block_numbers("sensors", table)
        new_run = False
        if self.run is not None:
            steps = np.diff(numbers, prepend=self.run.newest["sensors"])
            breaks = np.flatnonzero((steps < -WINDOW) | (steps > _FAR * self.run.buckets.blocks))
            new_run = bool(len(breaks)) or table.dtype != self.run.dtype
            if new_run:
                begin = breaks[-1] if len(breaks) else 0
                table, numbers, self.run = table[begin:], numbers[begin:], None
        if self.run is None:
            block_ns = _block_ns(table, numbers)
            if block_ns is None:
                return new_run
            self.run = _Run(block_ns, table.dtype)
            self._ended_at_s = None
            new_run = True
        keep = numbers > np.maximum.accumulate(np.append(self.run.newest["sensors"], numbers[:-1]))
        table, numbers = table[keep], numbers[keep]
        if not len(table):
            return new_run
        self.run.newest["sensors"] = int(numbers[-1])
        self._heard_s["sensors"] = self._clock()
        self._newest["sensors"] = table[-1:]
        self._taken["sensors"] = table
        self.run.scope.add_blocks(table, numbers)
        self.run.tally.add_blocks(numbers)
        return new_run

    def _take(self, topic: str, payloads: list[bytes]) -> None:
        if not payloads or self.run is None:
            return
        table = table_of(TRACE if topic == "trace" else APPLIED, payloads, topic)
        if not len(table):
            return
        numbers = block_numbers(topic, table)
        before = np.maximum.accumulate(np.append(self.run.newest[topic], numbers))
        # a block far ahead belongs to another run
        keep = (numbers >= before[:-1]) & (numbers <= self.run.newest["sensors"] + self.run.buckets.blocks * 200)
        table, numbers = table[keep], numbers[keep]
        if not len(table):
            return
        self.run.newest[topic] = int(numbers[-1])
        self._heard_s[topic] = self._clock()
        self._newest[topic] = table[-1:]
        self._taken[topic] = table
        self.run.buckets.add(topic, table)
        if topic == "applied":
            self.run.tally.add_applied(table)
            return
        self.run.tally.controller += int(table["gap_blocks"].sum())
        slips = table["slips"].astype(np.int64)
        self.run.scope.add_slips(slips, numbers)
        self.run.slips.append((self._clock(), int(slips[-1])))
        while self.run.slips[0][0] < self._clock() - _SLIPS_S:
            self.run.slips.popleft()

    def _take_events(self, received: list[Received]) -> list[EventRow]:
        fresh: list[EventRow] = []
        for message in received[:_EVENTS_AT_ONCE]:
            with contextlib.suppress(Fault):
                event = parsed(wire.Event, message.payload, message.topic.name)
                if event.code in (PAUSE, CORE_PAUSE):
                    self.pauses += 1
                    continue
                if event.code == "END" and message.topic.sender == "plant":
                    self._ended_at_s = event.t_ns * 1e-9
                fresh.append(_event_row(event, message.topic.sender))
        if len(received) > _EVENTS_AT_ONCE:
            text = f"{len(received) - _EVENTS_AT_ONCE} more events in one step; the log contains them"
            fresh.append(_event_row(wire.Event(code="FLOOD", text=text), "page"))
        self.events.extend(fresh)
        return fresh

    def _of(self, topic: str) -> Any:
        """Newest message of a topic; None if older than SILENT_S."""
        if self._clock() - self._heard_s.get(topic, -1e9) > SILENT_S:
            return None
        return self._newest[topic][0]

    def phase(self) -> str:
        """Phase of the connection: LIVE, or why no data arrive."""
        presence = self._source.presence
        if self._of("sensors") is not None:
            return LIVE
        if "plant" in presence.roles:  # after an END this is the next rig: the ended rig has left the bus
            return SILENT if self.run is not None and self._ended_at_s is None else WAITING
        if self.run is None:
            return WAITING
        return ENDED if self._ended_at_s is not None else LEFT

    def now(self) -> dict[str, Any]:
        """All current figures and words; None if unknown."""
        presence, run, phase = self._source.presence, self.run, self.phase()
        figures = self._figures() if phase == LIVE else {}
        recent, lost, late_us = self._slips_of_late(), None, None
        if run is not None:
            lost = {name: getattr(run.tally, name) for name in ("controller", "viewer", "commands", "late", "refused")}
            lost["dropped"] = self._source.inbox.dropped
            latency_us = run.tally.latency_us
            late_us = {"p50": latency_us.quantile(0.5) or None, "p99": latency_us.quantile(0.99) or None}
        return {
            "endpoint": self._where,
            "phase": phase,
            "silent_s": round(self._clock() - self._heard_s.get("sensors", self._began_s), 1),
            "answer": self.answer(phase, figures)._asdict(),
            "rig": plain(str(value_at(self._source.headers, "plant.rig.name") or "")[:80]),
            "other_rig": plain(other_rig(*(self._source.rigs.get(role, "")[:80] for role in ("plant", "controller")))),
            "roles": sorted(presence.roles),
            "limits": [{"words": label, "value": value} for label, value in stroke_limits(self._source.headers)],
            "slips_of_late": recent[0] if "slips" in figures else None,
            "slips_over_s": recent[1] if "slips" in figures else None,
            "lost": lost,
            "late_us": late_us,
            "unreadable": self.unreadable,
            "pauses": self.pauses,
            **figures,
        }

    def _figures(self) -> dict[str, Any]:
        block, trace, applied = self._of("sensors"), self._of("trace"), self._of("applied")
        figures: dict[str, Any] = {"t_s": round(float(block["t_ns"]) * 1e-9, 3)}
        records = {"sensors": block, "applied": applied, "trace": trace}
        for signal in SIGNALS.values():
            record = records.get(signal.topic)
            if record is not None:
                value = float(np.mean(record[signal.name]))
                figures[signal.name] = _number(value) if value != signal.unknown else None
        for signal in WORD_SIGNALS:
            record = records[signal.topic]
            if record is not None:
                figures[signal.field] = word_of(signal.column, int(record[signal.field]))
        if applied is not None:
            figures["fallback"] = bool(applied["fallback"])
        if trace is not None:
            v_a, v_d = figures["vibration_velocity_mps"], figures["drive_velocity_mps"]
            # at standstill or without input the trace repeats an old value
            measured = trace["state"] > wire.STANDSTILL and trace["limit"] not in (wire.STALE_INPUT, wire.NOT_FINITE)
            figures["velocity_ratio"] = v_a / abs(v_d) if v_a is not None and v_d and measured else None
            figures["breakaway_force_N"] = _number(trace["breakaway_force_N"]) or None
            figures["slips"] = int(trace["slips"])
        return figures

    def answer(self, phase: str, figures: Mapping[str, Any]) -> Answer:
        """Connection, or state of a live rig, in one sentence, with the remedy for a fault."""
        silent_s = self._clock() - self._heard_s.get("sensors", self._began_s)
        presence = self._source.presence
        if presence.trouble:
            return Answer(BAD, presence.trouble)
        if phase == WAITING:
            if "plant" in presence.roles:
                others = " and ".join(role for role in ("controller", "recorder") if role not in presence.roles)
                more = f": {others} {'is' if 'and' not in others else 'are'} missing" if others else ""
                return Answer(OFF, f"waiting: a rig is connected but has sent no block yet{more}")
            return Answer(OFF, f"waiting for a rig at {self._where}")
        if phase == SILENT:
            why = "the rig is on the bus but sends nothing" if presence.linked else "the link to the rig is down"
            return Answer(BAD, f"no data for {silent_s:.0f} s: {why}")
        if phase == ENDED:
            return Answer(OFF, f"the run ended {silent_s:.0f} s ago, at {self._ended_at_s:.1f} s; waiting for the next")
        if phase == LEFT:
            return Answer(BAD, f"the rig left {silent_s:.0f} s ago without an END; waiting for it")
        return of_a_live_rig(figures, *self._slips_of_late())

    def _slips_of_late(self) -> tuple[int, float]:
        """Number of slips in the last 10 s, and the actual window [s], which is shorter after the start of the run."""
        slips = self.run.slips if self.run is not None else ()
        return (slips[-1][1] - slips[0][1], round(slips[-1][0] - slips[0][0], 1)) if slips else (0, 0.0)


def _event_row(event: wire.Event, sender: str) -> EventRow:
    known = event_code(event.code)
    return EventRow(
        t_s=round(event.t_ns * 1e-9, 3),
        at=time.strftime("%H:%M:%S"),
        source=sender,
        code=plain(event.code[:40]),
        letter=known.letter,
        weight=SEVERITIES[known.letter],
        text=plain(event.text[:_LONGEST_TEXT]),
        help=known.help.replace("`", ""),
    )


def _number(value: Any) -> float | None:
    """A number for JSON; None if not finite."""
    return float(value) if np.isfinite(value) else None


def _block_ns(table: Records, numbers: Any) -> int | None:
    """Duration of a block, from two blocks; None with fewer, or if implausible."""
    if len(numbers) < 2 or numbers[-1] <= numbers[0]:
        return None
    length_ns = (int(table["t_ns"][-1]) - int(table["t_ns"][0])) / (int(numbers[-1]) - int(numbers[0]))
    return round(length_ns) if 1e4 <= length_ns <= 1e9 else None


def plain_help(column: str, word: str) -> str:
    """Meaning of a word in a column, for a screen or a page: without backticks."""
    return help_of(column, word).replace("`", "")


def of_a_live_rig(figures: Mapping[str, Any], slips: int, over_s: float) -> Answer:
    """Answer for a rig that sends blocks; `slips`: count over the last `over_s` [s]."""
    guard, cause = figures.get("guard_state"), figures.get("cause")
    mode, reason = figures.get("mode"), figures.get("reason")
    if guard == "FAULT":
        why = plain_help("cause", str(cause))
        more = "" if "reset" in why else "; nothing vibrates until a reset, then arm"
        return Answer(BAD, f"FAULT: {cause}: {why.partition(': ')[2]}{more}")
    if mode is None:
        return Answer(BAD, "no controller: the rig fades out by itself")
    if figures.get("fallback") and guard in {"ARMED", "ACTIVE", "NO_GUARD"}:
        return Answer(BAD, "the rig has no fresh command and ramps the vibration to zero by itself")
    if guard in {"DISARMED", "CHECKING", "READY"}:
        severity, _, why = plain_help("cause", str(cause)).partition(": ")
        more = f"; since {cause}: {why}" if severity in {SEVERITIES[FAILURE], SEVERITIES[OUTSIDE]} else ""
        return Answer(LOOK, f"{guard}: {plain_help('guard_state', guard)}{more}")
    summary = f"{mode}: {plain_help('mode', str(mode))}"
    if over_s >= 1.0:
        summary = f"{counted(slips, 'slip') if slips else 'no slip'} in the last {over_s:.0f} s; {summary}"
    if reason in {*WEAK_REASONS, *TRIPS}:
        return Answer(BAD if harms(str(reason)) else LOOK, f"{reason}: {plain_help('reason', str(reason))}; {summary}")
    return Answer(LOOK if slips else GOOD, summary)
