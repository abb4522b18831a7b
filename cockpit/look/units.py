"""Units of the columns of a record: of another quantity than a force, of a column without a stated unit, and in SI."""

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.table import Table
from bridge.tables.unit_words import known_unit, si_unit, weight_unit
from diagnosis.evidence.manifest_keys import ChannelMap
from diagnosis.evidence.mapped import calendar_unit_s
from diagnosis.look.guess import Guess

_OPTIONS = {
    "t_s": '--time "NAME [ms]"',
    "drive_force_N": '--force "NAME [kN]"',
    "drive_position_m": '--position "NAME [mm]"',
}


def counts(table: Table, channels: dict[str, ChannelMap]) -> str:
    """The column of the time, if it holds whole numbers and states no unit; else empty."""
    channel = channels.get("t_s")
    if channel is None or channel.unit or table.stated_unit(channel.column) or _is_time(table, channel):
        return ""
    values = table.column(channel.column)
    values = values[np.isfinite(values)]
    return channel.column if len(values) and (values == np.round(values)).all() else ""


def quantity(table: Table, channel: ChannelMap) -> str:
    """The quantity of a column by its unit; empty for an unknown unit."""
    return (known_unit(channel.unit or table.unit(channel.column)) or ("",))[0]


def own_unit(table: Table, guessed: Guess, channels: dict[str, ChannelMap], findings: list[Finding]) -> str:
    """The unit in which a column is printed that holds no force; empty for a force, a torque or a coefficient.

    The column keeps its numbers, and nothing is derived from them: neither stiffness nor mass nor a coefficient.
    """
    channel = channels["drive_force_N"]
    unit = channel.unit or table.stated_unit(channel.column)
    known = weight_unit(unit) if unit else None
    if not guessed.force or (known is not None and known[0] in ("force", "torque")):
        return ""
    if not unit:
        return "units" if guessed.stands_in else ""
    shown, factor = ("%" if known and known[0] == "share" and known[1] != 1.0 else unit), 1.0
    if known is not None and known[0] != "share":
        shown, factor = si_unit(known[0]), known[1]
    channels["drive_force_N"] = channel.model_copy(update={"scale": factor, "unit": ""})
    what = f"is a {known[0]}" if known is not None else f"has the unknown unit {unit!r}"
    text = f"{what}, no force: printed in {shown}, and no stiffness, mass or coefficient comes from it"
    findings.append(Finding("units", f"{table.path.name}: column {channel.column}", text))
    return shown


def si(table: Table, column: str, unit: str, findings: list[Finding]) -> Floats:
    """A load or a speed in SI units; without a stated unit it is taken as SI, with a finding."""
    known = (weight_unit if unit == "N" else known_unit)(table.unit(column))
    if known is None:
        add = "--load 94.5N" if unit == "N" else "--speed 0.5mm/s"
        text = f"states no known unit: taken as {unit}; add {add} if it is not"
        findings.append(Finding("assumed", f"{table.path.name}: {column}", text))
    return table.column(column) * (known[1] if known else 1.0)


def unitless(table: Table, channels: dict[str, ChannelMap], rate: bool) -> list[Finding]:
    """A finding for each channel without a stated unit. Raises Fault CONFIG for a time in an unknown unit."""
    if "t_s" in channels and not rate:
        unit = channels["t_s"].unit or table.stated_unit(channels["t_s"].column)
        if unit and known_unit(unit) is None:
            line = f"{table.path.name}: column {channels['t_s'].column}: {unit!r} is not a known unit of time"
            raise Fault("CONFIG", f"{line}; add --rate 1kHz in its place")
    assumed = {"t_s": "s", "drive_force_N": "N", "drive_position_m": "m"}
    return [
        Finding(
            "unit",
            f"{table.path.name}: {channel.column}",
            f"states no unit: taken as {assumed[name]}; else name it with its unit, as in {_OPTIONS[name]}",
        )
        for name, channel in channels.items()
        if channel.scale is None
        and not (channel.unit or table.stated_unit(channel.column))
        and table.find(channel.column) not in table.derived
        and not (name == "t_s" and (rate or _is_time(table, channel)))
    ]


def _is_time(table: Table, channel: ChannelMap) -> bool:
    times_s, counted_already = table.seconds(channel.column)
    return counted_already or calendar_unit_s(times_s) is not None
