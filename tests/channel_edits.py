"""Broken channels, made of the sensor blocks of a sound log: dead, cut, of another sign or scale, swapped, noise alone."""

from collections.abc import Callable
from typing import Any

import numpy as np

from bridge.log.check.channel import ChannelLimits
from bridge.log.logfile import RunData
from bridge.wire.channels import CHANNELS

Edit = Callable[[Any, int], None]  # of the sensor blocks, from a row on


def _dead(name: str, value: float | None) -> Edit:
    def edit(sensors: Any, begin: int) -> None:
        sensors[name][begin:] = sensors[name][len(sensors) // 2, -1] if value is None else value

    return edit


def _clipped(name: str) -> Edit:
    def edit(sensors: Any, begin: int) -> None:
        most = np.float32(0.6 * np.abs(sensors[name][begin:]).max())
        sensors[name][begin:] = np.clip(sensors[name][begin:], -most, most)

    return edit


def _scaled(name: str, factor: float) -> Edit:
    def edit(sensors: Any, begin: int) -> None:
        sensors[name][begin:] *= np.float32(factor)

    return edit


def _swapped(name: str, other: str) -> Edit:
    def edit(sensors: Any, begin: int) -> None:
        kept = sensors[name][begin:].copy()
        sensors[name][begin:] = sensors[other][begin:]
        sensors[other][begin:] = kept

    return edit


def _copied(name: str, other: str) -> Edit:
    def edit(sensors: Any, begin: int) -> None:
        sensors[name][begin:] = sensors[other][begin:]

    return edit


def _noise(name: str, of: ChannelLimits) -> Edit:
    def edit(sensors: Any, begin: int) -> None:
        noise = of.noise * np.random.default_rng(1).standard_normal(sensors[name][begin:].shape)
        mean = sensors[name][begin].mean() if name.endswith("_m") else 0.0
        sensors[name][begin:] = np.clip(mean + noise, of.low, of.high)

    return edit


def edits_of(name: str, of: ChannelLimits) -> dict[str, Edit]:
    """The edits of a channel by their names."""
    edits = {
        "zero": _dead(name, 0.0),
        "stuck": _dead(name, None),
        "clipped": _clipped(name),
        "negated": _scaled(name, -1.0),
        "x 0.5": _scaled(name, 0.5),
        "x 2": _scaled(name, 2.0),
        "x 10": _scaled(name, 10.0),
        "noise": _noise(name, of),
    }
    others = [other for other in CHANNELS if other != name]
    edits |= {f"swapped with {other}": _swapped(name, other) for other in others}
    return edits | {f"copy of {other}": _copied(name, other) for other in others if other[-2:] == "_m" == name[-2:]}


def edited(run: RunData, edit: Edit, from_s: float) -> RunData:
    """A log whose sensors broke at a time, and whose controller saw the broken ones, though it did as in the sound log."""
    sensors, trace = run.sensors.copy(), run.trace.copy()
    edit(sensors, int(np.searchsorted(sensors["t_ns"], from_s * 1e9)))
    at = np.searchsorted(sensors["sequence"], trace["block"]).clip(0, len(sensors) - 1)
    trace["drive_force_N"] = np.nan_to_num(sensors["drive_force_N"].mean(axis=1))[at]
    was, now = (table["base_accel_mps2"].std(axis=1) for table in (run.sensors, sensors))
    trace["vibration_velocity_mps"] *= np.nan_to_num(now / was.clip(1e-9))[at]
    return run._replace(sensors=sensors, trace=trace)
