"""The controller file, checked; numbers are in practical units."""

import math
from collections.abc import Collection
from typing import Annotated, Literal, get_args

from pydantic import Field, model_validator

from bridge.config import Strict
from bridge.guard import config as guard

Positive = Annotated[float, Field(gt=0)]
NotNegative = Annotated[float, Field(ge=0)]
MOST_BANDS = 2 * guard.MOST_BANDS  # most forbidden bands of frequency: of the rig, and of the controller alone
_FEWEST_SILENT_BLOCKS = 2  # fewest block periods in `stale_after_s`; with one, every block would be too late
Mode = Literal["on-demand", "moving"]
MODES: tuple[Mode, ...] = get_args(Mode)


class EstimatorConfig(Strict):
    """Inputs of the estimate of stick, slip and smooth sliding. Everything else is measured."""

    use_force: bool = Field(default=True, description="false: the rig has no force sensor; only positions show sticks.")
    use_slide_position: bool = Field(
        default=True, description="false: the rig has no slide position; force and drive_stiffness_N_per_m show sticks."
    )
    # 0.5 um/s is the drift of a transducer during warm-up; no axis feeds as slowly (30 um a minute)
    least_feed_mps: Positive = Field(default=5e-7, description="Drive speed up to which the drive counts as at rest.")


class PolicyConfig(Strict):
    """When to vibrate and when to stop."""

    gone = {
        "gentle_ratio": "least_ratio is the least v_a / v_d",
        **dict.fromkeys(("gentle_from", "too_late_from"), "a vibration begins as soon as a stick is seen"),
        **dict.fromkeys(
            ("first_probe_s", "probe_every_s", "probe_every_max_s", "probe_fade_s", "probe_hold_s"),
            "trial_every_s is the time between trials without vibration",
        ),
        **dict.fromkeys(("start_s", "settle_s"), "the modes start-only and settle ended"),
    }

    mode: Mode = Field(
        default="on-demand",
        description="When to vibrate. on-demand: once the slide sticks, while needed; moving: while the drive moves.",
    )
    enabled_from_s: NotNegative = Field(
        default=0.0, le=1e9, description="Time of the run from which vibration is allowed."
    )
    trial_every_s: Positive = Field(
        default=600.0,
        description="Vibrated time of motion between trials without vibration, where the vibration is known to be needed.",
    )
    # on the paper's rig 1.00 fails, 1.02 works at some frequencies, 1.05 at all with even friction; 1.07 adds a margin
    least_ratio: Annotated[float, Field(ge=1.02, le=1.5)] = Field(default=1.07, description="Least v_a / v_d to hold.")
    most_ratio: Annotated[float, Field(ge=1.2, le=3.0)] = Field(
        default=2.4, description="Largest v_a / v_d, after slips in spite of the vibration."
    )


class AmplitudeConfig(Strict):
    """The loop that brings the measured v_a to its set point."""

    gone = {"gain": "the exciter's gain is learnt"}

    filter_s: Positive = Field(default=0.005, description="Time constant of the measured v_a.")
    gain_band: Annotated[float, Field(ge=1.1, le=3.0)] = Field(
        default=1.4,
        description="Factor by which the exciter's gain may change at once, either way. It also limits the stroke, relative to "
        "the stroke at the known gain; beyond it the accelerometer is doubted.",
    )
    gain_floor: Annotated[float, Field(gt=0, le=1)] = Field(
        default=0.25,
        description="Share of the exciter's gain to which a warm exciter is followed; beyond it, it is at its end.",
    )
    known_gain: Positive | None = Field(
        default=None,
        description="Delivered over commanded v_a of the mounted exciter, the same at every frequency. Not given: measured "
        "at the first vibration.",
    )
    accel_bandwidth_Hz: Positive = Field(
        default=10000.0,
        description="Bandwidth of the base accelerometer; its roll-off at the vibration's frequency is corrected.",
    )
    accel_range_mps2: Positive = Field(
        default=490.3325, description="Range of the base accelerometer; the frequency is chosen to stay inside."
    )


class LimitsConfig(Strict):
    """Limits that no policy can exceed, and the set point of v_a / v_d.

    Amplitude, velocity, slew and frequencies are the rig's, from its header; a given value must be tighter. Without a velocity or
    slew in the header, the given value or the default holds, within the rig's guard.
    """

    v_ratio: Annotated[float, Field(ge=1.05, le=3.0)] = Field(default=1.2, description="Set point of v_a / v_d.")
    amplitude_max_m: Positive = 1e-7
    velocity_max_mps: Positive = 5e-3
    slew_m_per_s: Positive = 1e-6
    frequency_min_Hz: Positive = 500.0
    frequency_max_Hz: Positive = 5000.0
    # the carrier of the displacement transducers is 4.8 kHz: a vibration near it beats with it
    forbidden_Hz: Annotated[list[guard.Span], Field(max_length=MOST_BANDS)] = Field(
        default=[(4600.0, 5000.0)], description="Bands [low, high] without vibration."
    )
    travel_m: guard.Span | None = Field(
        default=None,
        description="Lowest and highest position of the drive at which the base may vibrate. Not given: any.",
    )
    # larger: a rig that hangs goes on vibrating; smaller: a late block ramps the vibration down
    stale_after_s: Annotated[float, Field(gt=0, le=5.0)] = Field(
        default=0.02, description="Time without a block after which the vibration ramps down."
    )


class ControllerConfig(Strict):
    """All keys of a controller file."""

    gone = {"onset": "the windows follow from the measured noise; see estimator"}
    block_s: Annotated[float, Field(ge=2.5e-4, le=0.02)] = 1e-3
    samples_per_block: Annotated[int, Field(ge=4, le=400)] = 20
    drive_stiffness_N_per_m: Positive | None = Field(
        default=None, description="k_d of the drive; it is measured. Not given: unknown until then."
    )
    contact_resonance_Hz: NotNegative = Field(
        default=1144.0,
        description="sqrt(k_t / m) / 2 pi of the contact; the vibration stays above 2.2 times this frequency.",
    )
    estimator: EstimatorConfig = EstimatorConfig()
    policy: PolicyConfig = PolicyConfig()
    amplitude: AmplitudeConfig = AmplitudeConfig()
    limits: LimitsConfig = LimitsConfig()

    @model_validator(mode="after")
    def _fits_together(self) -> "ControllerConfig":
        _refuse_unfit(self, LimitsConfig.model_fields["frequency_max_Hz"].default)
        return self


_CHANNEL_OF = {"use_force": "drive_force_N", "use_slide_position": "mass_position_m"}
_STEP_HZ = 100.0  # between two candidates of the vibration's frequency
# Lowest candidate over the contact resonance. Smaller: the v_a / v_d that stops stick-slip depends on the damping. Larger: fewer
# frequencies are left. From about 2 up, v_a / v_d = 1.05 stops stick-slip for any damping.
_ABOVE_RESONANCE = 2.2


def _refuse_unfit(config: ControllerConfig, most_Hz: float) -> None:
    """Raise ValueError for values that do not fit together; up to `most_Hz` the highest frequency may be raised."""
    limits = config.limits
    nyquist_Hz = 0.5 * config.samples_per_block / config.block_s
    if limits.frequency_max_Hz >= nyquist_Hz:
        raise ValueError(
            f"limits.frequency_max_Hz = {limits.frequency_max_Hz}: must be below half the sample rate, {nyquist_Hz:g} Hz; "
            f"lower it, or raise controller.samples_per_block and rig.solver.samples_per_block, both above "
            f"{2.0 * limits.frequency_max_Hz * config.block_s:g}"
        )
    if limits.stale_after_s < _FEWEST_SILENT_BLOCKS * config.block_s:
        raise ValueError(
            f"limits.stale_after_s = {limits.stale_after_s:g}: must hold {_FEWEST_SILENT_BLOCKS} blocks of "
            f"{config.block_s:g} s, or every block is too late; raise it"
        )
    lowest_Hz, from_where = _lowest_candidate(config)
    above_Hz = _STEP_HZ * math.ceil(lowest_Hz / _STEP_HZ)
    if above_Hz > limits.frequency_max_Hz:
        raises = f"raise it to {above_Hz:g} or more, or " if above_Hz <= most_Hz and above_Hz < nyquist_Hz else ""
        raise ValueError(
            f"limits.frequency_max_Hz = {limits.frequency_max_Hz:g}: no multiple of {_STEP_HZ:g} Hz lies between "
            f"{from_where} and it; {raises}lower the other value"
        )
    if not candidate_frequencies_Hz(config):
        raise ValueError(
            f"limits.forbidden_Hz: no frequency is left: every multiple of {_STEP_HZ:g} Hz between {from_where} and "
            f"limits.frequency_max_Hz = {limits.frequency_max_Hz:g} is forbidden; narrow the bands"
        )
    _refuse_blind(config)


def _refuse_blind(config: ControllerConfig) -> None:
    """Raise ValueError if the used channels show no stick."""
    if not (config.estimator.use_force or config.estimator.use_slide_position):
        raise ValueError(
            "estimator.use_force = false: use_slide_position is false as well, so no channel shows a stick; set one to true"
        )
    if not config.estimator.use_slide_position and config.drive_stiffness_N_per_m is None:
        raise ValueError(
            "drive_stiffness_N_per_m: not given, and use_slide_position = false: the force alone shows sticks only by k_d; "
            "give drive_stiffness_N_per_m"
        )


def seeing(config: ControllerConfig, absent: Collection[str]) -> ControllerConfig:
    """The configuration without the channels that a rig does not have. Raises ValueError if the others show no stick."""
    unused = {key: False for key, name in _CHANNEL_OF.items() if name in absent}
    if not unused:
        return config
    made = config.model_copy(update={"estimator": config.estimator.model_copy(update=unused)})
    _refuse_blind(made)
    return made


def looser_limits(limits: LimitsConfig, rig: guard.VibrationLimits) -> dict[str, float]:
    """The given limits that are looser than a rig's, with the rig's values; forbidden bands only add to the rig's."""
    bounds = {name: value for name, value in rig._asdict().items() if isinstance(value, float)}
    given = {name: getattr(limits, name) for name in bounds if name in limits.model_fields_set}
    return {
        name: bounds[name]
        for name, value in given.items()
        if (value < bounds[name] if name == "frequency_min_Hz" else value > bounds[name])
    }


def within(config: ControllerConfig, rig: guard.VibrationLimits) -> ControllerConfig:
    """The configuration with a rig's limits in place of those that are not given. Raises ValueError for a looser one."""
    limits = config.limits
    for name, bound in looser_limits(limits, rig).items():
        most = "at least" if name == "frequency_min_Hz" else "at most"
        line = f"limits.{name} = {getattr(limits, name):g}: must be {most} {bound:g}, the limit of the rig"
        raise ValueError(f"{line}; change it, or leave it out")
    given = limits.model_fields_set
    stated = {name: value for name, value in rig._asdict().items() if value is not None and name not in given}
    stated["forbidden_Hz"] = guard.merged_bands_Hz([*limits.forbidden_Hz, *rig.forbidden_Hz])
    # without a validation, which would count every value as given
    made = config.model_copy(update={"limits": LimitsConfig.model_construct(given, **dict(limits) | stated)})
    _refuse_unfit(made, rig.frequency_max_Hz)
    return made


def _lowest_candidate(config: ControllerConfig) -> tuple[float, str]:
    """The lower end of the candidates [Hz], and its origin as a text for messages."""
    lowest_Hz, resonance_Hz = config.limits.frequency_min_Hz, config.contact_resonance_Hz
    if (above_Hz := _ABOVE_RESONANCE * resonance_Hz) > lowest_Hz:
        return above_Hz, f"{above_Hz:g} Hz, {_ABOVE_RESONANCE:g} x contact_resonance_Hz = {resonance_Hz:g},"
    return lowest_Hz, f"limits.frequency_min_Hz = {lowest_Hz:g}"


def candidate_frequencies_Hz(config: ControllerConfig) -> list[float]:
    """The allowed frequencies to choose from, lowest first [Hz]; from 2.2 times the contact resonance on."""
    bands = guard.merged_bands_Hz(config.limits.forbidden_Hz)
    first = math.ceil(_lowest_candidate(config)[0] / _STEP_HZ)
    last = math.floor(config.limits.frequency_max_Hz / _STEP_HZ)
    return [_STEP_HZ * n for n in range(first, last + 1) if not any(low <= _STEP_HZ * n <= high for low, high in bands)]


def cheapest_frequency_Hz(config: ControllerConfig) -> float:
    """The allowed frequency whose v_a takes the least shares of the stroke and of the accelerometer's range [Hz].

    The sum of their squares counts. It does not depend on v_a, as both shares grow by it.
    """

    def cost(frequency_Hz: float) -> float:
        omega = math.tau * frequency_Hz
        return (1.0 / (omega * config.limits.amplitude_max_m)) ** 2 + (omega / config.amplitude.accel_range_mps2) ** 2

    return min(candidate_frequencies_Hz(config), key=cost)
