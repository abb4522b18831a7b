"""Channels of a TDMS file of LabVIEW, each on its own clock."""

from pathlib import Path
from typing import Any

import numpy as np

from bridge.tables.table import ChannelClock, Table


def read_tdms(path: Path) -> Table:
    """Channels as `GROUP/CHANNEL`, and as `CHANNEL` if only one group has a channel of that name.

    Clocks come from wf_increment, wf_start_offset and wf_start_time; they count from the earliest wf_start_time.
    """
    from nptdms import TdmsFile

    file: Any = TdmsFile.read(path)
    channels = [channel for group in file.groups() for channel in group.channels()]
    starts = {id(channel): channel.properties.get("wf_start_time") for channel in channels}
    stated = [np.datetime64(start, "ns") for start in starts.values() if start is not None]
    columns: dict[str, Any] = {}
    clocks: dict[str, ChannelClock] = {}
    units: dict[str, str] = {}
    names = [channel.name for channel in channels]
    for channel in channels:
        keys = [f"{channel.group_name}/{channel.name}"]
        keys += [channel.name] if names.count(channel.name) == 1 and channel.name != keys[0] else []
        step_s = float(channel.properties.get("wf_increment", 0.0))
        start = starts[id(channel)]
        late_s = float((np.datetime64(start, "ns") - min(stated)) / np.timedelta64(1, "ns")) * 1e-9 if start else 0.0
        for key in keys:
            columns[key] = channel[:]
            if unit := str(channel.properties.get("unit_string", "")):
                units[key] = unit
            if step_s > 0.0:
                clocks[key] = ChannelClock(late_s + float(channel.properties.get("wf_start_offset", 0.0)), step_s)
    return Table(path, columns, units=units, clocks=clocks)
