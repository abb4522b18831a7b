"""The table `[guard]` of a rig file: limits for the exciter that no controller can exceed. No limit can be raised online."""

from collections.abc import Sequence
from typing import Annotated, NamedTuple

from pydantic import AfterValidator, Field, model_validator

from bridge.config import Strict, Two

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
_LONGEST_S = 1e9  # longest time: 30 years; a far longer one overflows the count of blocks
HoldTime = Annotated[float, Field(ge=0, le=_LONGEST_S)]
Share = Annotated[float, Field(gt=0, le=1)]
MOST_BANDS = 8  # most forbidden bands


def _rising(ends: tuple[float, float]) -> tuple[float, float]:
    if ends[1] <= ends[0]:
        raise ValueError(f"[{ends[0]:g}, {ends[1]:g}]: the second must be above the first")
    return ends


Span = Annotated[Two, AfterValidator(_rising)]
Bands = Annotated[list[Span], Field(max_length=MOST_BANDS)]
_TONES = 5  # tones of a loop check without `check_Hz`
_LEAST_GAP_HZ = 2.0  # least gap between bands: a frequency in a band moves to 1 Hz outside, not into the next band


class VibrationLimits(NamedTuple):
    """The limits that guard and controller share, with the names of the controller's keys; None: not stated by the rig."""

    amplitude_max_m: Positive
    velocity_max_mps: Positive | None
    slew_m_per_s: Positive | None
    frequency_min_Hz: Positive
    frequency_max_Hz: Positive
    forbidden_Hz: Bands


class ExciterConfig(Strict):
    """The limits of an exciter, and the rate at which its amplitude may change."""

    # longest stroke of an exciter of a machine; longer commands are dropped
    amplitude_max_m: Annotated[float, Field(gt=0, le=1e-3)] = 1e-7
    frequency_min_Hz: Positive = 500.0
    frequency_max_Hz: Positive = 5000.0
    # 1 um/s reaches the paper's 0.02 um in 20 ms
    amplitude_slew_m_per_s: Annotated[float, Field(ge=0)] = Field(
        default=1e-6, description="Rate of the amplitude; 0: at once, as in the paper."
    )
    command_timeout_s: Annotated[float, Field(gt=0, le=5.0)] = 0.05


def merged_bands_Hz(bands: Sequence[Two]) -> list[tuple[float, float]]:
    """Forbidden bands from low to high; bands that overlap, or are less than 2 Hz apart, are merged."""
    merged: list[tuple[float, float]] = []
    for low, high in sorted(bands):
        if merged and low < merged[-1][1] + _LEAST_GAP_HZ:
            merged[-1] = (merged[-1][0], max(merged[-1][1], high))
        else:
            merged.append((low, high))
    return merged


class Level(Strict):
    """A limit: a command is held at `alarm`, a measured value reported; above `abort` for `hold_s` the rig goes to FAULT."""

    alarm: Positive
    abort: Positive
    hold_s: HoldTime = 0.2

    @model_validator(mode="after")
    def _in_order(self) -> "Level":
        if self.abort < self.alarm:
            raise ValueError(f"abort = {self.abort:g}: must not be below alarm = {self.alarm:g}")
        return self


class HeatConfig(Strict):
    """The exciter's warming: losses pi tan(d) C f (u0 / s)^2 of amplitude u0 at f, one thermal resistance, one time constant."""

    capacitance_F: Positive = Field(default=8e-7, description="Capacitance C of the stack.")
    stroke_m_per_V: Positive = Field(default=7.8e-8, description="Stroke per volt s of the stack.")
    loss_tangent: Positive = Field(default=0.2, description="tan(d) at large signal, ten times the data sheet's.")
    resistance_K_per_W: Positive = Field(
        default=20.0, description="Thermal resistance from the stack to its surroundings."
    )
    time_s: Positive = Field(default=60.0, description="Time constant of the warming.")
    rise_max_K: Positive = Field(
        default=30.0, description="Temperature rise above the surroundings at which the guard trips."
    )
    alarm_share: Share = Field(default=0.8, description="Share of rise_max_K from which the warming is reported.")


class GuardConfig(Strict):
    """The guard of one rig. `[piezo]` gives its frequencies and slew, and its stroke and velocity if they are not set here."""

    stroke_m: Level | None = Field(
        default=None, description="Commanded stroke. Not given: piezo.amplitude_max_m, abort at 1.5 times that."
    )
    fastest_drive_mps: Positive | None = Field(
        default=None,
        description="Fastest velocity of the drive; the guard trips at 1.5 times that. A real rig must give it; a simulated rig "
        "takes it from its drive.",
    )
    velocity_mps: Level | None = Field(
        default=None,
        description="v_a, commanded or measured. A real rig must give it; a simulated rig takes velocity_ratio times its fastest "
        "drive, over the least share that its exciter delivers.",
    )
    exciter_gain: Positive = Field(
        default=1.0,
        description="Delivered over commanded amplitude of the mounted exciter; 1 for a rigid mount. The first loop check must "
        "measure it within a factor of 1.5.",
    )
    velocity_ratio: Level = Field(
        default=Level(alarm=3.0, abort=4.0, hold_s=0.1),
        description="Commanded v_a, times the gain of the loop check but at least exciter_gain, over the drive's velocity.",
    )
    loud_ratio: Level = Field(
        default=Level(alarm=3.0, abort=4.0, hold_s=0.1), description="Measured v_a over the drive's velocity."
    )
    forbidden_Hz: Bands = Field(default=[], description="Bands [low, high] without vibration.")
    band_hold_s: HoldTime = Field(
        default=0.2, description="Time of commands at forbidden frequencies until the guard trips."
    )
    duty: Level = Field(
        default=Level(alarm=1.0, abort=1.0), description="Share of the time with vibration; 1: no limit."
    )
    duty_window_s: Positive = Field(default=60.0, description="Time constant of the duty.")
    heat: HeatConfig = HeatConfig()
    drive_memory_s: Positive = Field(
        default=0.5, description="Time constant of the memory of the drive's velocity: a vibration outlasts its move."
    )
    # The vibration is ramped to zero after 50 ms without a command; after this time it does not resume by itself. Smaller: with
    # 0.5 s a computer that stalls for 0.5 s leaves the axis without its controller until an operator arms it. Larger: with 1 s a
    # controller restarted 1 s later (`controller-restarted` in deploy/faults) vibrates again, v_a above 1.5 set points for 1.6 s.
    command_lost_s: Annotated[HoldTime, Field(gt=0)] = Field(
        default=0.75, description="Time without a fresh command until the rig is DISARMED."
    )
    check_Hz: Annotated[list[Positive], Field(max_length=8)] = Field(
        default=[],
        description="Frequencies of the loop check, rising, allowed ones. Not given: five over piezo's range, none forbidden.",
    )
    gain_change: Annotated[float, Field(ge=1.05, le=2.0)] = Field(
        default=1.25,
        description="Largest factor either way from the last accepted gain; beyond it the operator must accept the gain.",
    )
    check_share: Share = Field(default=0.1, description="Amplitude of the loop check, as a share of the stroke.")

    @model_validator(mode="after")
    def _in_order(self) -> "GuardConfig":
        if sorted(set(self.check_Hz)) != self.check_Hz:
            raise ValueError(f"check_Hz = {self.check_Hz}: must rise")
        return self

    def tones_Hz(self, lowest_Hz: float, highest_Hz: float) -> list[float]:
        """The frequencies of the loop check for an exciter with this range. Raises ValueError for a forbidden tone."""
        spaced = [lowest_Hz + (highest_Hz - lowest_Hz) * n / (_TONES + 1) for n in range(1, _TONES + 1)]
        for tone in self.check_Hz:
            if not lowest_Hz <= tone <= highest_Hz:
                raise ValueError(
                    f"guard.check_Hz = {tone:g}: must be within the exciter's range, {lowest_Hz:g} to {highest_Hz:g} Hz"
                )
            if self._forbids(tone):
                raise ValueError(
                    f"guard.check_Hz = {tone:g}: must be outside of guard.forbidden_Hz; choose another tone"
                )
        tones = self.check_Hz or [tone for tone in spaced if not self._forbids(tone)]
        if not tones:
            raise ValueError(
                "guard.forbidden_Hz: no tone is left for the loop check, and no rig is armed without it; narrow the bands, or "
                "set guard.check_Hz"
            )
        return tones

    def vibration_limits(self, exciter: ExciterConfig) -> VibrationLimits:
        """The limits that the header states and a controller must keep."""
        return VibrationLimits(
            self.stroke_m.alarm if self.stroke_m else exciter.amplitude_max_m,
            self.velocity_mps.alarm if self.velocity_mps else None,
            exciter.amplitude_slew_m_per_s or None,
            exciter.frequency_min_Hz,
            exciter.frequency_max_Hz,
            self.forbidden_Hz,
        )

    def _forbids(self, frequency_Hz: float) -> bool:
        return any(low <= frequency_Hz <= high for low, high in self.forbidden_Hz)
