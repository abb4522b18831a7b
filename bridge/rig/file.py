"""The rig file of a real rig: its adapter, the wiring and calibration of its channels, its exciter and its guard."""

import hashlib
import json
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, model_validator

from bridge.config import Strict
from bridge.formula import Formula
from bridge.guard.absent import ChannelName, PresentOrAbsent, absent, refusal
from bridge.guard.config import ExciterConfig, GuardConfig, Positive, VibrationLimits
from bridge.wire.channels import CHANNELS, SENSOR_CHANNELS

_NOT_ZERO = "scale = 0: must not be 0; give the SI units for one unit of the device"


def _scale(value: float) -> float:
    if value == 0.0:
        raise ValueError(_NOT_ZERO)
    return value


class ChannelConfig(PresentOrAbsent):
    """The table `[channels.NAME]` of a real rig: the value in SI units is sign x scale x raw + offset, or a formula."""

    source: Annotated[int, Field(ge=0, le=255)] | None = Field(
        default=None, description="Number of the device's channel, from 0."
    )
    derive: str | None = Field(
        default=None,
        description="Formula of + - * / ( ), numbers, measured channels in SI units and names of [numbers], in place of source.",
    )
    scale: Annotated[float, AfterValidator(_scale)] = Field(
        default=1.0, description="SI units for one unit of the device."
    )
    offset: float = Field(default=0.0, description="Value in SI units of a raw 0.")
    sign: Literal[1, -1] = Field(default=1, description="-1: the sensor counts backwards.")
    unit: str = Field(default="", description="Unit of the raw value, such as V; for the operator.")
    lowest: float | None = Field(default=None, description="Lowest value that the sensor measures, in SI units.")
    highest: float | None = Field(default=None, description="Highest value that the sensor measures, in SI units.")
    bandwidth_Hz: Positive | None = Field(
        default=None,
        description="Bandwidth of the sensor. For base_accel_mps2 the controller corrects v_a by it, and knows its range.",
    )

    @model_validator(mode="after")
    def _has_a_source(self) -> "ChannelConfig":
        given = [name for name in ("source", "derive") if getattr(self, name) is not None] + ["absent"] * self.absent
        if len(given) != 1:
            words = " and ".join(given) or "none"
            raise ValueError(
                f"source, derive, absent: {words} given: must be one of them; give source = NUMBER or absent = true"
            )
        if self.derive is not None:
            if scaled := [name for name in ("scale", "offset", "sign", "unit") if name in self.model_fields_set]:
                raise ValueError(f"{scaled[0]}: a derived channel is in SI units; put the factor into the formula")
            try:
                Formula(self.derive)
            except ValueError as error:
                raise ValueError(f"derive: {error}") from None
        return self


class ConverterConfig(Strict):
    """The table `[converter]`: the samples that make a block, by the device's clock."""

    sample_rate_Hz: Positive = 20_000.0
    samples_per_block: Annotated[int, Field(ge=4, le=400)] = 20

    @property
    def block_s(self) -> float:
        """Length of a block."""
        return self.samples_per_block / self.sample_rate_Hz

    @model_validator(mode="after")
    def _is_a_block(self) -> "ConverterConfig":
        if not 0.25e-3 <= self.block_s <= 20e-3:
            rule = "samples_per_block / sample_rate_Hz must be 0.00025 to 0.02 s; change samples_per_block"
            raise ValueError(f"a block of {self.block_s:g} s: {rule}")
        return self


class DeviceExciterConfig(ExciterConfig):
    """The table `[exciter]`: the limits of the exciter, and its wiring."""

    stroke_m_per_V: Positive | None = Field(
        default=None, description="Stroke for one volt of amplitude. Not given: the device takes metres."
    )
    adapter: str = Field(
        default="",
        description="Adapter of a separate exciter, as for the device. Not given: the device has the exciter.",
    )
    device: dict[str, Any] = Field(default={}, description="Settings of this adapter.")
    enable_line: bool = Field(default=False, description="Whether the device switches the amplifier's enable line.")
    watchdog_s: Annotated[float, Field(ge=0)] = Field(
        default=0.0, description="Silence after which the device itself ends the vibration; 0: it has no watchdog."
    )

    @model_validator(mode="after")
    def _has_an_adapter(self) -> "DeviceExciterConfig":
        if self.device and not self.adapter:
            raise ValueError(
                "device: settings without an adapter; give adapter, or use [device] for the device's exciter"
            )
        return self


class DeviceRig(Strict):
    """One rig file of a real rig."""

    name: str
    adapter: str = Field(description="A module of bridge.rig.adapters, or a file such as ./mine.py next to this one.")
    device: dict[str, Any] = Field({}, description="Settings of the adapter.")
    converter: ConverterConfig = ConverterConfig()
    channels: dict[ChannelName, ChannelConfig]
    numbers: dict[str, float] = Field({}, description="Numbers by name, for the formulas of derived channels.")
    exciter: DeviceExciterConfig = DeviceExciterConfig()
    guard: GuardConfig

    @model_validator(mode="after")
    def _is_whole(self) -> "DeviceRig":
        if missing := [name for name in CHANNELS if name not in self.channels]:
            raise ValueError(f"channels.{missing[0]}: missing; give its source, or absent = true")
        if reason := refusal(absent(self.channels)):
            raise ValueError(reason)
        if wrong := [name for name in self.numbers if name in CHANNELS or not Formula.is_name(name)]:
            raise ValueError(f"numbers.{wrong[0]}: must be a name of letters, digits and _, and no channel; rename it")
        for name, text in self.derived.items():
            place = f"channels.{name}.derive = {text!r}"
            if needed := SENSOR_CHANNELS[name].needed:
                raise ValueError(f"{place}: this channel must be measured: {needed}; give its source")
            known = [*self.measured, *self.numbers]
            if unknown := sorted(Formula(text).names - set(known)):
                raise ValueError(f"{place}: {unknown[0]}: no measured channel and no number; known: {', '.join(known)}")
        return self

    @property
    def measured(self) -> dict[str, int]:
        """Row of each measured channel in the samples of the device."""
        return {name: channel.source for name, channel in self.channels.items() if channel.source is not None}

    @property
    def derived(self) -> dict[str, str]:
        """Formula of each derived channel."""
        return {name: channel.derive for name, channel in self.channels.items() if channel.derive is not None}

    @property
    def rows(self) -> dict[str, int]:
        """Row of each channel that the rig has, where the derived channels follow the rows of the device."""
        return self.measured | {name: self.sources + row for row, name in enumerate(self.derived)}

    @property
    def vibration_limits(self) -> VibrationLimits:
        """The limits that the header states and a controller must keep."""
        return self.guard.vibration_limits(self.exciter)

    @property
    def solver(self) -> ConverterConfig:
        """Length and samples of a block, by the name that a simulated rig and the header give them."""
        return self.converter

    @property
    def sources(self) -> int:
        """Number of channels that the device must have."""
        return 1 + max(self.measured.values())

    def header(self) -> dict[str, Any]:
        """The rig in the header of its process: rate, blocks, calibration, exciter and guard, and a checksum of all of it."""
        blocks = {"block_s": self.converter.block_s, "samples_per_block": self.converter.samples_per_block}
        table = self.model_dump(mode="json", exclude={"device": True, "exciter": {"device"}}) | {"solver": blocks}
        return table | {"checksum": hashlib.sha256(json.dumps(table, sort_keys=True).encode()).hexdigest()}
