"""The facts, stages and blocks of a session with a device or with a rig on the bus. Nothing is judged here.

The vibration equals the loop check's, a tenth of the stroke. The drive may rest or move; nothing here moves it.
"""

import math
from collections.abc import Iterator
from typing import NamedTuple

from bridge.guard.config import VibrationLimits, merged_bands_Hz
from bridge.rig.conformance.heard import Stage

REST_S, TONE_S, HALF_S, STEP_S = 3.0, 0.3, 0.2, 0.04
STEPS = 5  # the fastest answer counts, so that a busy computer does not fail a device
_ODD = 0.382  # far from a whole period, and so are its double and its triple
_NYQUIST_SHARE = 0.4  # highest tone over the sampling rate


class Ended(Exception):
    """The session cannot continue; the text gives the reason."""


class Facts(NamedTuple):
    """The facts of a rig that a session needs."""

    rate_Hz: float
    samples: int
    limits: VibrationLimits
    check_share: float
    gain: float
    fastest_mps: float
    absent: frozenset[str]
    ranges: dict[str, tuple[float | None, float | None]]
    answer_blocks: int  # blocks in which an order begins at the latest
    answer_s: float = 0.0  # more of them
    derived: frozenset[str] = frozenset()
    watchdog_s: float = 0.0
    has_line: bool = False

    @property
    def block_s(self) -> float:
        """Length of a block."""
        return self.samples / self.rate_Hz

    @property
    def amplitude_m(self) -> float:
        """Amplitude of the tones."""
        return self.check_share * self.limits.amplitude_max_m

    @property
    def ramp_s(self) -> float:
        """Time of the ramp to it."""
        slew = self.limits.slew_m_per_s
        return self.amplitude_m / slew if slew else 0.0

    @property
    def tones_Hz(self) -> tuple[float, float]:
        """Two frequencies, at 1/3 and 2/3 of the exciter's range."""
        low, high = self.limits.frequency_min_Hz, self.limits.frequency_max_Hz
        high = min(high, max(_NYQUIST_SHARE * self.rate_Hz, low))
        return self._odd_Hz(low + (high - low) / 3.0), self._odd_Hz(high - (high - low) / 3.0)

    def _odd_Hz(self, tone_Hz: float) -> float:
        """A frequency near a tone with 0.38 periods, and whole ones, in a block: then a lost block shows in the phase."""
        low, high = self.limits.frequency_min_Hz, self.limits.frequency_max_Hz
        odd_Hz = (math.floor(tone_Hz * self.block_s) + _ODD) / self.block_s
        for wanted_Hz in (odd_Hz, tone_Hz):
            if low <= wanted_Hz <= high and not any(a <= wanted_Hz <= b for a, b in self.limits.forbidden_Hz):
                return wanted_Hz
        return next((b + 1.0 for a, b in merged_bands_Hz(self.limits.forbidden_Hz) if a <= tone_Hz <= b), tone_Hz)


class Session:
    """The blocks and failures of one session."""

    def __init__(self, facts: Facts, pace: str) -> None:
        self.facts, self.pace = facts, pace
        self.stages: dict[str, list[Stage]] = {}
        self.failures: dict[str, str] = {}  # by call of the device
        self.longest_s: dict[str, list[float]] = {"read": [], "write": []}  # times of the calls
        self.bad_block = ""
        self.bad_count = ""
        self.problems: list[str] = []  # reported by the adapter
        self.lost = 0
        self.has_guard = False  # on the wire
        self.passed_blocks = 0.0  # block lengths of the pause, by the computer's clock
        self.seen_blocks = 0  # blocks that the device reported for it, lost ones included

    def stage(self, name: str) -> Stage:
        """Blocks of all stages of a name."""
        return [block for stage in self.stages.get(name, []) for block in stage]


def tones_and_steps(facts: Facts, settled_s: float) -> Iterator[tuple[str, float, float, float]]:
    """The stages of any session that show frequency, amplitude and answer: name, time [s], frequency [Hz], amplitude [m]."""
    first_Hz, most_m = facts.tones_Hz[0], facts.amplitude_m
    loud = [(f"tone {tone_Hz:g}", TONE_S, tone_Hz, most_m) for tone_Hz in facts.tones_Hz]
    loud += [("half", HALF_S, first_Hz, 0.5 * most_m), *[("step", STEP_S, first_Hz, most_m)] * STEPS]
    for name, for_s, frequency_Hz, amplitude_m in loud:
        yield name, for_s + settled_s, frequency_Hz, amplitude_m
        yield "zero", settled_s, frequency_Hz, 0.0
