"""Faults of a device that show in the times of its blocks, and in the vibration that it executes."""

import collections

from bridge.rig.device import DeviceBlock, DeviceError

Problem = tuple[str, str, int]  # code of an event, text, and number of occurrences
# Reads in a row without a block from which the device is late. Smaller: a read that the computer delays once. Larger: a loop
# that lags by 10 ms, a third of the controller's margin for it, without a report.
_LATE_READS = 3
# Two windows in a row must show an equal error of the rate: a late block makes one window long and the next one short. Smaller: a
# block 6 ms late counts in both. Larger: a clock that is 3 % off is found after more than 1 s.
_WINDOW_S = 0.4
_FAR = 0.015  # error of the rate found in two windows; a smaller one is measured over 10 s, by `bridge.rig.rate`
# The executed amplitude must lie between those ordered within this time. Smaller: a generator that takes 30 ms for each of two
# lines. Larger: a vibration that is too strong lasts longer.
_ANSWER_S = 0.1
_MARGIN = 0.1  # share of the ordered amplitude by which the executed one may differ
# Time above the ordered amplitudes until the connection ends; with `_ANSWER_S` and the ramp below 0.2 s.
_TOO_STRONG_S = 0.05
_TOO_WEAK_S = 0.3  # time below them until a report


class DeviceWatch:
    """Watches a device between two of its silences.

    Args:
        block_s: length of a block by the device's clock.
        read_s: longest time of a `read` without a block.
        has_clock: whether the device makes its blocks by its own clock.

    """

    def __init__(self, block_s: float, read_s: float, has_clock: bool) -> None:
        self._block_s, self._read_s, self._has_clock = block_s, read_s, has_clock
        self._empty_reads = 0
        self._window_s: float | None = None  # begin of the present window
        self._window_blocks = 0
        self._errors: list[float] = []  # of the rate in the last windows; empty once reported
        self._orders = collections.deque([0.0], maxlen=max(round(_ANSWER_S / block_s), 1))
        self._largest = 0.0
        self._off_blocks, self._off_from = 0, 0.0
        self.failure: DeviceError | None = None  # of a vibration above every order of the last 0.1 s

    def empty(self) -> None:
        """Note a read without a block."""
        self._empty_reads += 1

    def order(self, amplitude: float) -> None:
        """Note an ordered amplitude, in the device's unit."""
        self._orders.append(amplitude)
        self._largest = max(self._largest, amplitude)

    def look(self, block: DeviceBlock, now_s: float) -> list[Problem]:
        """Note a block that was read at a time [s]; return new problems."""
        problems: list[Problem] = []
        if self._has_clock and self._empty_reads >= _LATE_READS:
            problems.append(("DEVICE_LATE", f"no block for {1e3 * self._empty_reads * self._read_s:.0f} ms", 1))
        self._empty_reads = 0
        self._window_blocks += 1 + block.lost
        if self._has_clock and not block.waiting and (error := self._rate_error(now_s)):
            text = f"{1.0 + error:.3f} times the rate of the rig file by the computer's clock"
            problems.append(("DEVICE_RATE", f"{text}: v_d and every frequency are wrong by this factor", 1))
        return [*problems, *self._executed(block.amplitude)]

    def _rate_error(self, now_s: float) -> float:
        """Relative error of the rate once two windows show it; else 0."""
        if self._window_s is not None and now_s - self._window_s < _WINDOW_S:
            return 0.0
        if self._window_s is not None:
            self._errors.append(self._window_blocks * self._block_s / (now_s - self._window_s) - 1.0)
        self._window_s, self._window_blocks = now_s, 0
        last = self._errors[-2:]
        if len(last) < 2 or min(map(abs, last)) < _FAR or last[0] * last[1] < 0.0:
            return 0.0
        self._errors = []
        return (last[0] + last[1]) / 2.0

    def _executed(self, amplitude: float) -> list[Problem]:
        newest = self._orders[-1]
        if abs(amplitude - newest) <= _MARGIN * newest:
            self._off_blocks = 0
            return []
        margin, highest = _MARGIN * self._largest, max(self._orders)
        above = amplitude > highest + margin
        if not above and amplitude >= min(self._orders) - margin:
            self._off_blocks = 0
            return []
        if self._off_blocks == 0:
            self._off_from = amplitude
        self._off_blocks += 1
        if self._off_blocks != round((_TOO_STRONG_S if above else _TOO_WEAK_S) / self._block_s):
            return []
        code = "DEVICE_REFUSED" if amplitude == self._off_from else "DEVICE_SLOW"
        bound = f"more than {highest:g}" if above else f"less than {min(self._orders):g}"
        text = f"it executes {amplitude:g}, {bound}, the orders of the last {_ANSWER_S:g} s"
        if above:
            self.failure = DeviceError(f"{text}: the connection was ended", code)
            return []
        return [(code, text, 1)]
