"""The controller file, in units of people."""

import math
from typing import Annotated

from pydantic import Field, model_validator

from bridge.config import Strict, Two

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
Share = Annotated[float, Field(gt=0, le=1)]
LONGEST_WINDOW_BLOCKS = 128  # length of the rings of force and position
# Blocks in a window of a slope. Fewer: the slope is noise. 8 blocks with 6 mN of noise give 0.9 N/s, a stick climbs 5.85 N/s.
FEWEST_WINDOW_BLOCKS = 8
MOST_BANDS = 8  # forbidden bands of frequency
_FEWEST_SILENT_BLOCKS = 2  # in `stale_after_s`; with fewer every block would come too late


class OnsetConfig(Strict):
    """How stick, slip and smooth sliding are told apart."""

    # Window of the slope of the force. Shorter: noise looks like stick. Longer: stick is seen late.
    # A slope is five sigma in (300 sigma^2 / (f_s (k_d v_d)^2))^(1/3) = 9 ms at 20 mN and 5.85 N/s; the default is twice that.
    window_s: Positive = Field(default=0.02, description="Window of the slope of the force.")
    velocity_window_s: Positive = Field(default=0.04, description="Window of the slope of the drive position, v_d.")
    stick_force_rate: Annotated[float, Field(gt=0, lt=1)] = Field(
        default=0.5, description="Share of k_d v_d above which the contact sticks."
    )
    # Fall of the force over 3 ms that makes a slip: 0.5 N on the paper's rig. Smaller: noise (0.01 N) counts. Larger: small slips
    # do not.
    slip_drop_N: Positive = Field(default=0.15, description="Fall of the force over 3 ms that makes a slip.")
    slip_burst_mps2: Positive = Field(  # the paper's rig reaches 2.6
        default=0.2, description="Rms of the slide's acceleration that confirms a slip."
    )
    standstill_mps: Positive = Field(default=2e-5, description="Drive velocity up to which the drive stands.")
    breakaway_force_N: NotNegative = Field(default=0.0, description="0: learnt from the measured slips.")


class PolicyConfig(Strict):
    """When to vibrate and when to stop."""

    enabled_from_s: NotNegative = Field(default=0.0, description="From the start of the run.")
    gentle_ratio: Annotated[float, Field(ge=1.05, le=1.5)] = Field(
        default=1.12, description="v_a / v_d while breakaway is near."
    )
    # Shares of the breakaway force from which a vibration starts gently, or not at all. Larger: the vibration causes the slip
    # that it should prevent (above 0.85 on the paper's rig). Smaller: the controller waits out more slips.
    gentle_from: Share = Field(
        default=0.8, description="Share of the breakaway force from which a vibration starts gently."
    )
    too_late_from: Share = Field(
        default=0.85, description="Share of the breakaway force from which no vibration starts."
    )
    probe_every_s: Positive = Field(
        default=30.0,
        description="Doubles with every probe that finds the vibration still needed, up to probe_every_max_s.",
    )
    probe_every_max_s: Positive = 600.0
    probe_fade_s: Positive = 0.5
    probe_hold_s: Positive = 3.0


class AmplitudeConfig(Strict):
    """The loop that brings the measured v_a to its set point; `loop_design` gives its margins."""

    # Share of the logarithmic error that one block corrects. Larger: the loop rings. Smaller: it settles late.
    # Phase margin 60 degrees and gain margin 6.3 with this filter and commands 2 blocks late: controller/loop_design.py.
    gain: Positive = Field(default=0.0826, description="Share of the logarithmic error that one block corrects.")
    filter_s: Positive = Field(default=0.005, description="Time constant of the demodulated amplitude.")
    accel_bandwidth_Hz: Positive = Field(
        default=10000.0,
        description="Of the base accelerometer; its roll-off at the vibration's frequency is corrected.",
    )


class LimitsConfig(Strict):
    """Limits that no policy can exceed, and the set point of v_a / v_d."""

    v_ratio: Annotated[float, Field(ge=1.05, le=3.0)] = Field(default=1.2, description="Set point of v_a / v_d.")
    amplitude_max_m: Positive = 1e-7
    velocity_max_mps: Positive = 5e-3
    slew_m_per_s: Positive = 1e-6
    frequency_min_Hz: Positive = 500.0
    frequency_max_Hz: Positive = 5000.0
    # the carrier of the displacement transducers is 4.8 kHz: a vibration near it beats with it
    forbidden_Hz: Annotated[list[Two], Field(max_length=MOST_BANDS)] = Field(
        default=[(4600.0, 5000.0)], description="Bands [low, high] in which nothing is vibrated."
    )
    # silence after which the vibration ramps down: longer vibrates a rig that has frozen, shorter ramps down for a late block
    stale_after_s: Annotated[float, Field(gt=0, le=5.0)] = Field(
        default=0.02, description="Silence after which the vibration ramps down."
    )


class ControllerConfig(Strict):
    """One controller."""

    block_s: Positive = 1e-3
    samples_per_block: Annotated[int, Field(ge=4, le=400)] = 20
    drive_stiffness_N_per_m: Positive = 11700.0
    contact_resonance_Hz: NotNegative = Field(
        default=1144.0, description="sqrt(k_t / m) / 2 pi of the contact; the vibration keeps above 2.2 times this."
    )
    onset: OnsetConfig = OnsetConfig()
    policy: PolicyConfig = PolicyConfig()
    amplitude: AmplitudeConfig = AmplitudeConfig()
    limits: LimitsConfig = LimitsConfig()

    @model_validator(mode="after")
    def _fits_together(self) -> "ControllerConfig":
        limits, onset, policy = self.limits, self.onset, self.policy
        if limits.frequency_max_Hz <= limits.frequency_min_Hz:
            raise ValueError(
                f"limits.frequency_max_Hz = {limits.frequency_max_Hz}: must be above "
                f"limits.frequency_min_Hz = {limits.frequency_min_Hz}"
            )
        nyquist_Hz = 0.5 * self.samples_per_block / self.block_s
        if limits.frequency_max_Hz >= nyquist_Hz:
            raise ValueError(
                f"limits.frequency_max_Hz = {limits.frequency_max_Hz}: must be below half the sample rate, {nyquist_Hz:g} Hz"
            )
        if limits.stale_after_s < _FEWEST_SILENT_BLOCKS * self.block_s:
            raise ValueError(
                f"limits.stale_after_s = {limits.stale_after_s:g}: must hold {_FEWEST_SILENT_BLOCKS} blocks of "
                f"{self.block_s:g} s, or every block comes too late; raise it"
            )
        for low, high in limits.forbidden_Hz:
            if high <= low:
                raise ValueError(f"limits.forbidden_Hz: [{low}, {high}]: the second must be above the first")
        lowest_Hz, from_where = _lowest_candidate(self)
        step_Hz = _candidate_step_Hz(self)
        above_Hz = step_Hz * math.ceil(lowest_Hz / step_Hz)
        if above_Hz > limits.frequency_max_Hz:
            raise ValueError(
                f"limits.frequency_max_Hz = {limits.frequency_max_Hz:g}: no multiple of {step_Hz:g} Hz lies between "
                f"{from_where} and it; raise it to {above_Hz:g} or more"
            )
        if not candidate_frequencies_Hz(self):
            raise ValueError(
                f"limits.forbidden_Hz: no frequency is left: every multiple of {step_Hz:g} Hz between {from_where} and "
                f"limits.frequency_max_Hz = {limits.frequency_max_Hz:g} is forbidden; narrow the bands"
            )
        for name, window_s in (("window_s", onset.window_s), ("velocity_window_s", onset.velocity_window_s)):
            blocks = window_s / self.block_s
            if not FEWEST_WINDOW_BLOCKS <= blocks <= LONGEST_WINDOW_BLOCKS:
                raise ValueError(
                    f"onset.{name} = {window_s:g}: must hold {FEWEST_WINDOW_BLOCKS} to {LONGEST_WINDOW_BLOCKS} blocks of "
                    f"{self.block_s:g} s; write {FEWEST_WINDOW_BLOCKS * self.block_s:g} to "
                    f"{LONGEST_WINDOW_BLOCKS * self.block_s:g}"
                )
        if policy.too_late_from <= policy.gentle_from:
            raise ValueError(
                f"policy.too_late_from = {policy.too_late_from}: must be above policy.gentle_from = {policy.gentle_from}"
            )
        return self


MOST_CANDIDATES = 64  # frequencies to choose from; more: finer steps, more memory
# Lowest candidate over the contact resonance. Smaller: the v_a / v_d that stops stick-slip depends on the damping. Larger: fewer
# frequencies are left. From about 2 up, v_a / v_d = 1.05 stops stick-slip for any damping.
_ABOVE_RESONANCE = 2.2
_LEAST_GAP_HZ = 2.0  # between bands: a frequency in a band moves to 1 Hz beside it, which must not lie in the next band


def forbidden_bands_Hz(limits: LimitsConfig) -> list[tuple[float, float]]:
    """The forbidden bands from low to high; bands that overlap, or are less than 2 Hz apart, become one."""
    bands: list[tuple[float, float]] = []
    for low, high in sorted(limits.forbidden_Hz):
        if bands and low < bands[-1][1] + _LEAST_GAP_HZ:
            bands[-1] = (bands[-1][0], max(bands[-1][1], high))
        else:
            bands.append((low, high))
    return bands


def _lowest_candidate(config: ControllerConfig) -> tuple[float, str]:
    """The lower end of the candidates [Hz], and where it comes from, in words."""
    limits = config.limits
    above_Hz = _ABOVE_RESONANCE * config.contact_resonance_Hz
    if limits.frequency_min_Hz < above_Hz < limits.frequency_max_Hz:
        return above_Hz, f"{above_Hz:g} Hz, {_ABOVE_RESONANCE:g} x contact_resonance_Hz,"
    return limits.frequency_min_Hz, f"limits.frequency_min_Hz = {limits.frequency_min_Hz:g}"


def _candidate_step_Hz(config: ControllerConfig) -> float:
    range_Hz = config.limits.frequency_max_Hz - _lowest_candidate(config)[0]
    return 100.0 * max(1, math.ceil(range_Hz / (100.0 * (MOST_CANDIDATES - 1))))


def candidate_frequencies_Hz(config: ControllerConfig) -> list[float]:
    """The frequencies to choose from, lowest first [Hz]: above the contact resonance where the range allows, none forbidden."""
    bands, step_Hz = forbidden_bands_Hz(config.limits), _candidate_step_Hz(config)
    first = math.ceil(_lowest_candidate(config)[0] / step_Hz)
    last = math.floor(config.limits.frequency_max_Hz / step_Hz)
    return [step_Hz * n for n in range(first, last + 1) if not any(low <= step_Hz * n <= high for low, high in bands)]
