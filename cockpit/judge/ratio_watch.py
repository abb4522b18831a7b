"""v_a over v_d while the rig vibrates, with a lower and an upper limit.

Below 1.05 stick-slip may return. Far above the set point (OVER_EXCITED) the vibration wears exciter, mount and workpiece without
benefit, or v_a is measured wrongly. The set point is the configured one, or a higher one if the controller raised it after a slip
or surge. Judged are steps in EXCITE with an evenly moving drive, after the ramp, except stalls of the computer: then v_a is as
old as the last block before it. In the second after a stall only the upper limit holds, as the vibration begins again.
"""

import math
from typing import NamedTuple

import numpy as np

from bridge.arrays import Bools, Floats
from bridge.log.watches.arrays import Longest
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import GAP, LATE, NO_BLOCK, STALE
from cockpit.judge.setup import SETTLING_S, Setup
from cockpit.judge.watches import STANDSTILL_MPS
from cockpit.judge.window import Rows, Window

ALARM_RATIO = 1.05
# Largest v_a / v_d in set points, and longest time above it without a break. In a sound run a rising set point or a resonance of
# the mount exceeds it repeatedly for the 10 to 60 ms of the loop's response. Shipped scenarios: 0.02 s at most.
# Smaller ratio: a drive that slows down by more than a third fails. Shorter: the delay of the loop counts. Larger: a loop that
# vibrates harder than commanded passes.
_MOST_SET_POINTS = 1.5
MOST_ABOVE_S = 0.2
_RAMP_S = 0.15  # not judged after each begin of vibration: 40 ms of ramp at the default slew, and the filter of v_a
_STEADY_S, _STEADY_SHARE = 0.1, 0.1  # motion is even if the drive velocity changes by less than this share in this time
_RAMPED_DOWN = (wire.STALE_INPUT, wire.NOT_FINITE, wire.OPERATOR_STOP)  # limits that fade the vibration: not judged
_LATE_BLOCKS = 2.0  # lateness of the plant, in block times, above which it counts as a stall of the computer


class RatioVerdict(NamedTuple):
    """v_a over v_d in a run; all 0 if nothing was judged."""

    lowest: float
    highest: float
    judged_s: float
    below_s: float  # time below 1.05: a warning, not a failure, as a run without slips is ok
    above_s: float  # time above 1.5 set points, total
    longest_above_s: float  # the longest such stretch
    left_out_s: float  # time of vibration not judged: in stalls and the second after each

    @property
    def ok(self) -> bool:
        """True if v_a / v_d never exceeded 1.5 set points for more than 0.2 s."""
        return self.longest_above_s <= MOST_ABOVE_S

    def in_words(self) -> str:
        """A line; empty if nothing was judged."""
        if not self.judged_s:
            return ""
        wrong: list[str] = []
        if self.below_s:
            wrong.append(f"below {ALARM_RATIO} for {self.below_s:.2f} s: stick-slip may return")
        if not self.ok:
            wrong.append(
                f"above {_MOST_SET_POINTS:g} set points for {self.longest_above_s:.2f} s: look at exciter and accelerometer"
            )
        out = f", without {self.left_out_s:.1f} s around stalls" if self.left_out_s else ""
        return f"{self.lowest:.2f} to {self.highest:.2f} while vibrating{out} ({'; '.join(wrong) or 'ok'})"


class RatioWatch:
    """v_a over v_d, window by window."""

    def __init__(self, setup: Setup) -> None:
        self._setup, self._block_s = setup, setup.block_s
        self._above = Longest()
        self._lowest, self._highest = math.inf, 0.0
        self._judged = self._below = self._all_above = self._left_out = 0
        self._events = 0  # slips and surges that the controller counted before it was enabled

    def add(self, window: Window) -> None:
        """Add the steps of a window; the rows before it show earlier ramps and stalls."""
        trace = window.trace
        t_s, speed_mps = trace["t_ns"] * 1e-9, np.abs(trace["drive_velocity_mps"])
        judged = window.own(trace)
        excited = (trace["mode"] == wire.EXCITE) & ~np.isin(trace["limit"], _RAMPED_DOWN)
        counts = judged & excited & (_since_begin(excited) * self._block_s > _RAMP_S) & self._steady(speed_mps)
        counts &= (t_s > self._setup.settled_from_s) & np.isfinite(trace["vibration_velocity_mps"])
        after = self._after_stall(t_s, trace, window.applied)
        self._left_out += int(np.count_nonzero(counts & after))
        ratio = np.divide(trace["vibration_velocity_mps"], speed_mps, out=np.zeros(len(trace)), where=counts)
        shown = counts & ((trace["events"] & (GAP | STALE | LATE)) == 0)
        self._highest = max(self._highest, float(ratio[shown].max(initial=0.0)))
        above = self._is_above(trace, ratio, shown)[judged]
        self._all_above += int(np.count_nonzero(above))
        self._above.add(above)
        counts &= ~after
        self._lowest = min(self._lowest, float(ratio[counts].min(initial=math.inf)))
        self._judged += int(np.count_nonzero(counts))
        self._below += int(np.count_nonzero(ratio[counts] < ALARM_RATIO))

    def _is_above(self, trace: Rows, ratio: Floats, counts: Bools) -> Bools:
        """Steps above 1.5 set points; without a slip or surge under control the set point is the configured one."""
        counted = trace["slips"].astype(np.int64) + trace["surges"]
        before = counted[trace["t_ns"] * 1e-9 <= self._setup.enabled_from_s]
        self._events = int(before[-1]) if len(before) else self._events
        # older logs have no set point in the trace
        raised = np.where(counted != self._events, trace["velocity_ratio"], 0.0)
        return np.asarray(counts & (ratio > _MOST_SET_POINTS * np.maximum(raised, self._setup.v_ratio)))

    def _steady(self, speed_mps: Floats) -> Bools:
        steady, back = np.zeros(len(speed_mps), bool), max(round(_STEADY_S / self._block_s), 1)
        now_mps = speed_mps[back:]
        changed_mps = np.abs(now_mps - speed_mps[: len(now_mps)])
        steady[back:] = (now_mps > STANDSTILL_MPS) & (changed_mps < _STEADY_SHARE * now_mps)
        return steady

    def _after_stall(self, t_s: Floats, trace: Rows, applied: Rows) -> Bools:
        """Steps in a stall of plant or controller, or in the second after it."""
        # a fallback before the first command does not count as a stall
        answers = applied["command_block"] != np.uint64(NO_BLOCK)
        stalls = ((applied["fallback"] != 0) & answers) | (applied["late_ns"] > _LATE_BLOCKS * self._block_s * 1e9)
        stalled_s = t_s[(trace["events"] & (GAP | STALE | LATE)) != 0]
        at_s = np.sort(np.concatenate([[-math.inf], applied["t_ns"][stalls] * 1e-9, stalled_s]))
        last = np.searchsorted(at_s, t_s + 0.5 * self._block_s, side="right") - 1
        return np.asarray(t_s - at_s[last] <= SETTLING_S)

    def result(self) -> RatioVerdict:
        """Figures at the end of the log."""
        steps = self._judged, self._below, self._all_above, self._above.longest, self._left_out
        lowest = self._lowest if self._judged else 0.0
        return RatioVerdict(lowest, self._highest, *(count * self._block_s for count in steps))


def _since_begin(excited: Bools) -> Floats:
    """Steps since the begin of the vibration; infinite for a vibration in the first row, which began earlier."""
    index = np.arange(len(excited), dtype=np.float64)
    return index - np.maximum.accumulate(np.where(excited, -math.inf, index)) - 1.0
