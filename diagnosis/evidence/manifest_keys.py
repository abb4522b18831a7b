"""Keys that a manifest and a channel map share: the standard columns and their sources."""

from typing import Annotated, Any

from pydantic import Field, model_validator

from bridge.arrays import Floats
from bridge.config import Strict
from bridge.tables.unit_words import known_unit
from bridge.wire.channels import SENSOR_CHANNELS, Channel

Columns = dict[str, Floats]  # [samples] by standard name
VIBRATION = {  # commanded values
    "vibration_frequency_Hz": Channel("vibration_frequency_Hz", "frequency", "frequency", 0, 1e6, has_spikes=True),
    # piezo stacks move by a tenth of a millimetre
    "vibration_amplitude_m": Channel("vibration_amplitude_m", "length", "angle", 1, 1e-3, has_spikes=True),
}
USUAL = {"t_s": Channel("t_s", "time", "time", 0, has_spikes=True), **SENSOR_CHANNELS, **VIBRATION}
FURTHER = {  # measured on some rigs
    "mass_velocity_mps": Channel("mass_velocity_mps", "velocity", "angular velocity", 1, has_spikes=True),
    "drive_velocity_mps": Channel("drive_velocity_mps", "velocity", "angular velocity", 1, has_spikes=True),
    "normal_load_N": Channel("normal_load_N", "force", "force", 0),
    "other_force_N": Channel("other_force_N", "force", "torque", -1),
    "motor_current_A": Channel("motor_current_A", "current", "current", 0, has_spikes=True),
}
STANDARD = USUAL | FURTHER
# The upper limit is far above any rig, and low enough that no product of such numbers overflows.
Positive = Annotated[float, Field(gt=0, lt=1e12)]
NotNegative = Annotated[float, Field(ge=0, lt=1e12)]


class ChannelMap(Strict):
    """Source of a standard column: value = column * scale + offset, in its SI unit. A text alone names the column."""

    column: Annotated[str, Field(min_length=1)] = Field(description="Name of the column, or its number, from 1 on.")
    scale: float | None = Field(default=None, description="Factor to SI; if not given, from the unit of the column.")
    offset: float = Field(default=0.0, description="Offset in SI units.")
    unit: str = Field(default="", description="Unit of the column, such as mm or kN, if its name does not state it.")

    @model_validator(mode="before")
    @classmethod
    def _text_is_the_column(cls, table: Any) -> Any:
        if isinstance(table, str | int) and not isinstance(table, bool):
            table = {"column": table}
        if isinstance(table, dict) and isinstance(table.get("column"), int) and not isinstance(table["column"], bool):
            table = table | {"column": str(table["column"])}
        return table

    @model_validator(mode="after")
    def _scale_is_right(self) -> "ChannelMap":
        if self.unit and known_unit(self.unit) is None:
            raise ValueError(f"unit = {self.unit!r}: must be a known unit, such as mm, kN, g or ms; else give a scale")
        if self.unit and self.scale is not None:
            raise ValueError("scale and unit: must be one of them; remove the other")
        if self.scale == 0.0:
            raise ValueError("scale = 0: must not be 0, it would erase the column; 1 keeps it unchanged")
        return self


def check_channel_names(channels: dict[str, Any]) -> None:
    """Raise ValueError when a channel is not a standard column."""
    for name in channels:
        if name not in STANDARD:
            raise ValueError(f"channels.{name}: unknown key; known here: {', '.join(STANDARD)}")
