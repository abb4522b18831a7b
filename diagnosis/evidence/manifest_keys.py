"""Keys that a manifest and a channel map share: the standard columns and their sources, and how a file is written."""

import re
from collections.abc import Mapping
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, model_validator

from bridge.arrays import Floats
from bridge.config import Strict, unknown_key
from bridge.formula import Formula
from bridge.tables.kinds import Kind
from bridge.tables.unit_words import known_unit
from bridge.wire.channels import SENSOR_CHANNELS, Channel

if TYPE_CHECKING:
    from bridge.tables.text.dialect import Dialect

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
    """Source of a standard column: value = column * scale + offset, in its SI unit. A text alone names the column.

    A column may be a formula of columns in SI units too, and `derive` is the key that a rig file has for it.
    """

    column: Annotated[str, Field(min_length=1)] = Field(description="Name of the column, or its number, from 1 on.")
    derive: str | None = Field(
        default=None,
        description="Formula of + - * / ( ), numbers, columns in SI units and names of [numbers], in place of column.",
    )
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
        if isinstance(table, dict) and isinstance(formula := table.get("derive"), str):
            if "column" in table or "scale" in table:
                raise ValueError(
                    "derive: a derived channel has no column and no scale; put the factor into the formula"
                )
            try:
                Formula(formula)
            except ValueError as error:
                raise ValueError(f"derive: {error}") from None
            table = table | {"column": formula}
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
            raise ValueError(f"channels.{name}: {unknown_key(name, list(STANDARD))}")


def with_numbers(channels: Mapping[str, ChannelMap], numbers: Mapping[str, float]) -> dict[str, ChannelMap]:
    """The channels with the values of [numbers] in their formulas. Raises ValueError for a name that no formula can have."""
    if wrong := [name for name in numbers if not Formula.is_name(name)]:
        raise ValueError(f"numbers.{wrong[0]}: must be a name of letters, digits and _; rename it")
    result = dict(channels)
    for name, channel in channels.items():
        if channel.derive is not None and numbers:
            names = "|".join(map(re.escape, numbers))
            text = re.sub(rf"\b({names})\b", lambda match: f"({numbers[match[0]]!r})", channel.derive)
            result[name] = channel.model_copy(update={"column": text, "derive": text})
    return result


class SourceMap(Strict):
    """How the source file is written."""

    sample_rate_Hz: Annotated[float, Field(ge=1.0, le=1e7)] | None = Field(
        default=None, description="Sampling rate, where no column holds the time."
    )
    format: Kind | None = Field(default=None, description="Format of the file, where its first bytes do not show it.")
    delimiter: Annotated[str, Field(min_length=1, max_length=1)] | None = Field(
        default=None, description="Mark between columns; a blank means any number of blanks and tabs."
    )
    decimal: Literal[".", ","] | None = Field(default=None, description="Decimal mark.")
    thousands: Annotated[str, Field(max_length=1)] | None = Field(default=None, description="Thousands separator.")
    skip_rows: Annotated[int, Field(ge=0)] | None = Field(
        default=None, description="Lines before the line of the names."
    )
    encoding: str | None = None
    names: list[str] | None = Field(default=None, description="Names of the columns, where the file has none.")
    units_row: bool | None = Field(default=None, description="Whether a line of units follows the names.")
    comment: Annotated[str, Field(min_length=1)] | None = Field(
        default=None, description="Beginning of the lines that are skipped."
    )
    sheet: str | None = Field(default=None, description="Sheet of a workbook.")

    @property
    def dialect(self) -> "Dialect":
        """The keys for a text or a sheet."""
        from bridge.tables.text.dialect import Dialect  # noqa: PLC0415  imports pyarrow, which few commands need

        given = self.model_dump(exclude={"sample_rate_Hz", "format", "names"})
        return Dialect(**given, names=None if self.names is None else tuple(self.names))
