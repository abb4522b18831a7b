"""A log as an expectation sees it: samples of a signal, gaps in them, and the time with a controller in charge."""

from functools import cached_property
from typing import NamedTuple

import numpy as np

from bridge.arrays import Bools, Floats
from bridge.log.check.channel import channels_of
from bridge.log.damage import damage_findings
from bridge.log.logfile import RunData, block_period_ns
from bridge.log.metadata import is_number, value_at
from bridge.log.watches.arrays import median
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import NO_BLOCK
from cockpit.expect.events import times_of
from cockpit.expect.tables import STATES, Limits
from cockpit.figures.signals import SIGNALS, holds, limits_of, samples_of
from cockpit.judge.judged import judge_tables
from cockpit.judge.setup import plant_of

_IN_CHARGE = (wire.ARMED, wire.ACTIVE)
# Range of a signal at rest over its noise. 10: an hour of samples exceeds it. 100: with noise of 50 nm, 5 um of travel are rest.
_STILL = 15.0


class Samples(NamedTuple):
    """Samples of a signal or state, in order of time, [samples]."""

    t_s: Floats
    values: Floats  # SI units, or numbers of words; NaN: not a number in the log
    known: Bools  # False: the log marks the value as unknown
    period_s: float  # from one message to the next; 0 with fewer than two


class Record:
    """One finished log. Raises Fault BAD_LOG for a log whose configuration is damaged.

    Args:
        run: the log.
        duration_s: length of the test; not given: the length of the run.

    """

    def __init__(self, run: RunData, duration_s: float | None = None) -> None:
        self.run, self._duration_s = run, duration_s
        self._plant = plant_of(run.headers, run.path)
        self.block_s = block_period_ns(run.sensors) * 1e-9
        self.last_s = float(run.sensors["t_ns"][-1]) * 1e-9 if len(run.sensors) else 0.0

    @property
    def end_s(self) -> float:
        """Planned end of the test; its last block where that is unknown."""
        planned = value_at(self._plant, "duration_s") if self._duration_s is None else self._duration_s
        return self.begin_s + float(planned) if is_number(planned) and planned > 0 else self.last_s

    @cached_property
    def begin_s(self) -> float:
        """Time at which the times of expectations begin: a real rig is armed after its check, a simulated one from the start."""
        armed = np.flatnonzero(np.isin(self.run.applied["guard_state"], _IN_CHARGE))
        if value_at(self._plant, "rig.adapter") in {None, "sim"} or not len(armed) or not armed[0]:
            return 0.0
        return float(self.run.applied["t_ns"][armed[0]]) * 1e-9

    @cached_property
    def damage(self) -> str:
        """The first damage of the log in words; empty for a whole one.

        Messages that an injected fault spoiled do not count: the log holds them unchanged, and their samples are missing.
        """
        damage = self.run.damage
        faults = value_at(self._plant, "fault")
        if any(
            value_at(row, "kind") in {"corrupted", "truncated"} for row in (faults if isinstance(faults, list) else ())
        ):
            damage = damage._replace(bad_records=0)
        findings = damage_findings(damage, self.run.path)
        if self.run.checksums.changed:
            return "its bytes were changed after it was written"
        return findings[0].text if findings else "" if damage.whole else "it was not closed"

    @cached_property
    def events(self) -> dict[str, list[float]]:
        """Times of each word of an event [s]."""
        return times_of(self.run)

    @cached_property
    def slips_s(self) -> Floats | None:
        """Times of the slips by the judge of runs; None without a force."""
        _, cycles = judge_tables(self.run)
        return None if cycles is None else cycles.breakaway_t_s

    @cached_property
    def _in_charge(self) -> tuple[Floats, Bools]:
        """Time of each block, and whether a controller was in charge in it, [blocks]."""
        applied = self.run.applied
        t_s = applied["t_ns"] * 1e-9
        armed = np.isin(applied["guard_state"], _IN_CHARGE)
        fresh = (applied["fallback"] == 0) & (applied["command_block"] != np.uint64(NO_BLOCK))
        enabled = np.zeros(len(t_s), bool)
        if "controller" in self.run.headers:
            from_s = value_at(self.run.configuration("controller"), "policy.enabled_from_s")
            enabled = t_s > (float(from_s) if is_number(from_s) else 0.0)
        return t_s, armed & fresh & enabled

    def charge_share(self, from_s: float, to_s: float) -> float:
        """Share of the blocks of a window in which a controller was in charge; 0 without a block."""
        t_s, charge = self._in_charge
        inside = (t_s > from_s) & (t_s <= to_s)
        return float(np.count_nonzero(charge & inside)) / max(int(np.count_nonzero(inside)), 1)

    @property
    def why_not_in_charge(self) -> str:
        """The remedy of a run, or of its begin, without a controller in charge."""
        if not np.isin(self.run.applied["guard_state"], _IN_CHARGE).any():
            return "arm the rig: arm = true in the scenario, and --arm for a real rig"
        return "controller.policy.enabled_from_s must be earlier, or the window later"

    def rests(self, from_s: float, to_s: float) -> bool:
        """Whether the position of the drive stays within its noise in a window; False if one is unknown."""
        position, channel = self.samples("drive_position_m"), channels_of(self._plant)["drive_position_m"]
        if position is None:
            return False
        inside = position.values[(position.t_s > from_s) & (position.t_s <= to_s)]
        return bool(len(inside)) and float(np.ptp(inside)) < _STILL * max(channel.noise, channel.step)

    def samples(self, name: str) -> Samples | None:
        """Samples of a signal; None if the log does not contain it."""
        if not holds(self.run, name) or value_at(self._plant, f"rig.channels.{name}.absent"):
            return None
        signal = SIGNALS[name]
        t_s, values = samples_of(self.run, signal)
        table = getattr(self.run, signal.topic)
        if signal.unknown is None:
            return Samples(t_s, values, np.ones(len(values), bool), _period_s(t_s))
        known = table[name] != signal.unknown
        return Samples(t_s, table[name].astype(np.float64), known, _period_s(t_s))

    def states(self, name: str) -> Samples | None:
        """Numbers of the words of a state; None if the log does not contain it."""
        state = STATES[name]
        table = getattr(self.run, state.topic)
        if not len(table):
            return None
        t_s = table["t_ns"] * 1e-9
        return Samples(t_s, table[state.field].astype(np.float64), np.ones(len(t_s), bool), _period_s(t_s))

    def range_of(self, name: str) -> Limits:
        """Limits that a signal cannot exceed, by the configuration in the log; infinite where unknown."""
        if SIGNALS[name].topic == "sensors":
            channel = channels_of(self._plant)[name]
            return Limits(channel.low, channel.high)
        strokes = [limit for _, limit in limits_of(self.run, "amplitude")] if name == "amplitude_m" else []
        return Limits(-np.inf, min(strokes, default=np.inf))


def _period_s(t_s: Floats) -> float:
    return median(np.diff(t_s)) if len(t_s) > 1 else 0.0
