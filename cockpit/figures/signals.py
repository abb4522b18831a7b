"""What can be drawn of a log: each signal's name, symbol, unit, and where in the log it is."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.faults import Fault
from bridge.log.logfile import RunData, block_period_ns, sample_times_s
from bridge.log.metadata import is_number
from cockpit.judge.setup import absent_channels

Floats = npt.NDArray[np.float64]


class Signal(NamedTuple):
    """One signal; its values in a log are SI units, and `factor` makes of them what is shown."""

    name: str  # as in the tables of `log export`
    symbol: str  # as in the paper; empty where there is none
    words: str
    axis: str  # what the axis is called; neighbours with one axis and one unit share it
    topic: str
    factor: float
    unit: str
    colour: str
    unknown: float | None = None  # the value that stands for "not known"

    @property
    def title(self) -> str:
        """`F_d, drive force`, with the symbol as matplotlib sets it."""
        if not self.symbol:
            return self.words
        base, _, index = self.symbol.partition("_")
        return f"${base}_{{\\mathrm{{{index}}}}}$, {self.words}" if index else f"${base}$, {self.words}"

    @property
    def axis_title(self) -> str:
        """`velocity [mm/s]`."""
        return f"{self.axis} [{self.unit}]" if self.unit else self.axis


_INK, _RED, _BLUE, _GREEN, _GREY, _BROWN = "#1f2d3a", "#b5402a", "#2a6fb5", "#1e8449", "#808b96", "#9a6a1c"

SIGNALS = {
    one.name: one
    for one in (
        Signal("drive_force_N", "F_d", "drive force", "drive force", "sensors", 1.0, "N", _INK),
        Signal("vibration_velocity_mps", "v_a", "vibration, measured", "velocity", "trace", 1e3, "mm/s", _BLUE),
        Signal("drive_velocity_mps", "v_d", "drive, measured", "velocity", "trace", 1e3, "mm/s", _RED),
        Signal("wanted_velocity_mps", "", "vibration, set point", "velocity", "trace", 1e3, "mm/s", _GREY),
        Signal("sliding_velocity_mps", "v_s", "slide, mean over a window", "velocity", "trace", 1e3, "mm/s", _GREEN),
        Signal("velocity_ratio", "", "v_a over v_d, measured", "v_a / v_d", "state", 1.0, "", _BLUE, unknown=0.0),
        Signal("amplitude_m", "u_0", "amplitude of the base, applied", "amplitude", "applied", 1e9, "nm", _BLUE),
        Signal("wanted_amplitude_m", "", "amplitude asked for", "amplitude", "trace", 1e9, "nm", _GREY),
        Signal("frequency_Hz", "f", "frequency, applied", "frequency", "applied", 1.0, "Hz", _BROWN, unknown=0.0),
        Signal("time_to_slip_s", "", "predicted time to slip", "time to slip", "trace", 1.0, "s", _BROWN, unknown=-1.0),
        Signal("score", "", "score of stick-slip, 0 to 1", "score", "trace", 1.0, "", _RED),
        Signal("force_rate", "s", "rate of the force, 1 when stuck", "force rate", "trace", 1.0, "", _INK),
        Signal("mass_accel_mps2", "", "slide's acceleration", "acceleration", "sensors", 1.0, "m/s²", _GREEN),
        Signal("base_accel_mps2", "", "base's acceleration", "acceleration", "sensors", 1.0, "m/s²", _BLUE),
        Signal("mass_position_m", "x", "slide's position", "position", "sensors", 1e3, "mm", _GREEN),
        Signal("drive_position_m", "s_d", "drive's position", "position", "sensors", 1e3, "mm", _RED),
        Signal("round_trip_ns", "", "block out to command in", "round trip", "applied", 1e-3, "µs", _BROWN, unknown=0),
        Signal("heat_share", "", "exciter's warmth, over the allowed", "warmth", "applied", 1e2, "%", _RED),
    )
}
USUAL = ("drive_force_N", "vibration_velocity_mps", "drive_velocity_mps")  # of the picture of a run
_USUAL_OF_IMPORT = ("drive_force_N", "mass_position_m", "drive_position_m", "mass_accel_mps2", "base_accel_mps2")


def named(text: str, run: RunData) -> list[Signal]:
    """The signals of a comma-separated list; of an empty one what is usually shown of such a log.

    Raises Fault CONFIG for an unknown name, or one that the log does not hold.
    """
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    imported = "import" in run.headers
    if not names:
        return [SIGNALS[name] for name in (_USUAL_OF_IMPORT if imported else USUAL) if not imported or holds(run, name)]
    for name in names:
        if name not in SIGNALS:
            raise Fault("CONFIG", f"--signals {name}: no signal of a log; known: {', '.join(SIGNALS)}")
        if imported and not holds(run, name):
            there = ", ".join(one for one in SIGNALS if holds(run, one))
            raise Fault("CONFIG", f"--signals {name}: not in {run.path.name}; choose from {there}")
    return [SIGNALS[name] for name in names]


def holds(run: RunData, name: str) -> bool:
    """Whether a log holds a signal at all."""
    signal = SIGNALS[name]
    if signal.topic == "sensors" and name in absent_channels(run.headers, run.path):
        return False
    return len(getattr(run, signal.topic)) > 0


def samples_of(run: RunData, signal: Signal) -> tuple[Floats, Floats]:
    """Time [s] and values in SI units, [samples]; nan where the value is not known."""
    table = getattr(run, signal.topic)
    if not len(table):
        return np.empty(0), np.empty(0)
    values = table[signal.name].astype(np.float64)
    if signal.topic == "sensors":
        return sample_times_s(table, block_period_ns(table)).ravel(), values.ravel()
    if signal.unknown is not None:
        values[values == signal.unknown] = np.nan
    return table["t_ns"] * 1e-9, values


def limits_of(run: RunData, axis: str) -> list[tuple[str, float]]:
    """Limits of an axis in the configuration of a log, in words and in SI units; none where the log does not tell."""
    if axis != "amplitude":
        return []
    return stroke_limits({role: run.configuration(role) for role in ("controller", "plant") if role in run.headers})


def stroke_limits(configurations: Mapping[str, Any]) -> list[tuple[str, float]]:
    """Limits of the amplitude [m] in the configurations of rig and controller, by role, in words."""
    found: list[tuple[str, float]] = []
    for role, keys, words in (
        ("controller", ("limits", "amplitude_max_m"), "controller's limit"),
        ("plant", ("rig", "guard", "stroke_m"), "guard's limit"),
        ("plant", ("rig", "piezo", "amplitude_max_m"), "exciter's stroke"),
    ):
        value: Any = configurations.get(role)
        for key in keys:
            value = value.get(key) if isinstance(value, dict) else None
        if is_number(value):
            same = next((number for number, one in enumerate(found) if one[1] == value), None)
            if same is None:
                found.append((words, float(value)))
            else:
                found[same] = (f"{found[same][0]} and {words}", float(value))
    return found
