"""Drawable signals of a log and of a running rig: name, symbol, unit, topic, panel. A new signal is a row of a table here."""

from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.log.logfile import RunData, block_period_ns, sample_times_s
from bridge.log.metadata import is_number, value_at
from cockpit.judge.setup import absent_channels


class Panel(NamedTuple):
    """Curves with one axis on the pages of `review` and `serve`."""

    title: str
    hint: str  # text above the curves
    is_open: bool = True  # unfolded at first

    @property
    def signals(self) -> list["PlottedSignal"]:
        """Signals of this panel, in the order of `SIGNALS`."""
        return [signal for signal in SIGNALS.values() if signal.panel == self]

    def heading(self) -> dict[str, Any]:
        """Titles of the panel and of its axis, for a page."""
        first = self.signals[0]
        return {"title": self.title, "hint": self.hint, "open": self.is_open, "unit": first.unit, "axis": first.axis}


class PlottedSignal(NamedTuple):
    """One signal; logs contain SI units, and `factor` converts them to `unit`."""

    name: str  # column in the tables of `log export`
    symbol: str  # symbol in the paper; may be empty
    words: str
    axis: str  # title of the axis; neighbours with equal axis and unit share a panel
    topic: str
    factor: float
    unit: str
    colour: str
    panel: Panel | None = None  # panel on the pages; None: on no page
    unknown: float | None = None  # value that means "not known"

    @property
    def title(self) -> str:
        """`F_d, drive force`, with the symbol as a matplotlib formula."""
        if not self.symbol:
            return self.words
        base, _, index = self.symbol.partition("_")
        return f"${base}_{{\\mathrm{{{index}}}}}$, {self.words}" if index else f"${base}$, {self.words}"

    def for_page(self) -> dict[str, Any]:
        """Name, label and colour of the curve, for a page."""
        return {"name": self.name, "symbol": self.symbol, "words": self.words, "colour": self.colour}

    @property
    def axis_title(self) -> str:
        """Name and unit of the axis, such as `velocity [mm/s]`."""
        return f"{self.axis} [{self.unit}]" if self.unit else self.axis


_INK, _RED, _BLUE, _GREEN, _GREY, _BROWN = "#1f2d3a", "#b5402a", "#2a6fb5", "#1e8449", "#808b96", "#9a6a1c"

# fmt: off
PANELS = (
    Panel("Drive force",
        "Rises while the slide sticks and falls when it slips (red triangle). Smooth sliding is a level line."),
    Panel("Vibration against drive",
        "Stick-slip ends where v_a exceeds the drive's speed: blue above red or, on the way back, above red's mirror image."),
    Panel("Amplitude of the base against its stroke",
        "Amplitude of the base, zero to peak. Dashed: its limit. A curve at the limit has no reserve."),
    Panel("Predicted time to the next slip",
        "Time until a detected stick is expected to break away. No curve: the controller expects no slip."),
    Panel("Positions", "The slide rests in a stick and jumps in a slip.", is_open=False),
    Panel("Accelerations", "The base shows the vibration; the slide shows a peak at each slip.", is_open=False),
    Panel("Frequency of the vibration", "As applied by the exciter.", is_open=False),
)
_FORCE, _SPEEDS, _STROKE, _TO_SLIP, _POSITIONS, _ACCEL, _FREQUENCY = PANELS

SIGNALS = {
    signal.name: signal
    for signal in (
        PlottedSignal("drive_force_N", "F_d", "drive force", "drive force", "sensors", 1.0, "N", _INK, _FORCE),
        PlottedSignal("vibration_velocity_mps", "v_a", "vibration, measured", "velocity", "trace", 1e3, "mm/s", _BLUE, _SPEEDS),
        PlottedSignal("drive_velocity_mps", "v_d", "drive, measured", "velocity", "trace", 1e3, "mm/s", _RED, _SPEEDS),
        PlottedSignal("wanted_velocity_mps", "", "vibration, set point", "velocity", "trace", 1e3, "mm/s", _GREY, _SPEEDS),
        PlottedSignal("sliding_velocity_mps", "v_s", "slide, mean over a window", "velocity", "trace", 1e3, "mm/s", _GREEN),
        PlottedSignal("velocity_ratio", "", "v_a over v_d, measured", "v_a / v_d", "state", 1.0, "", _BLUE, unknown=0.0),
        PlottedSignal("amplitude_m", "u_0", "amplitude of the base, applied", "amplitude", "applied", 1e9, "nm", _BLUE, _STROKE),
        PlottedSignal("wanted_amplitude_m", "", "amplitude, commanded", "amplitude", "trace", 1e9, "nm", _GREY, _STROKE),
        PlottedSignal("frequency_Hz", "f", "frequency, applied", "frequency", "applied", 1.0, "Hz", _BROWN, _FREQUENCY,
            unknown=0.0),
        PlottedSignal("time_to_slip_s", "", "predicted time to slip", "time to slip", "trace", 1.0, "s", _BROWN, _TO_SLIP,
            unknown=-1.0),
        PlottedSignal("force_rate", "s", "rate of the force, 1 when stuck", "force rate", "trace", 1.0, "", _INK),
        PlottedSignal("base_accel_mps2", "", "base's acceleration", "acceleration", "sensors", 1.0, "m/s²", _BLUE, _ACCEL),
        PlottedSignal("mass_accel_mps2", "", "slide's acceleration", "acceleration", "sensors", 1.0, "m/s²", _GREEN, _ACCEL),
        PlottedSignal("mass_position_m", "x", "slide's position", "position", "sensors", 1e3, "mm", _GREEN, _POSITIONS),
        PlottedSignal("drive_position_m", "s_d", "drive's position", "position", "sensors", 1e3, "mm", _RED, _POSITIONS),
        PlottedSignal("round_trip_ns", "", "block to command", "round trip", "applied", 1e-3, "µs", _BROWN, unknown=0),
        PlottedSignal("answer_ns", "", "exciter's answer time", "round trip", "applied", 1e-3, "µs", _GREY, unknown=0),
        PlottedSignal("sample_rate_Hz", "", "rate of the samples, measured", "rate", "applied", 1.0, "Hz", _INK, unknown=0.0),
        PlottedSignal("heat_share", "", "exciter's temperature rise / limit", "heating", "applied", 1e2, "%", _RED),
    )
}
# fmt: on


class WordSignal(NamedTuple):
    """A code of a log and of a running rig, shown as a word."""

    title: str
    column: str  # column in `bridge.wire.words`
    topic: str
    field: str
    is_band: bool = True  # drawn as a band over time


WORD_SIGNALS = (
    WordSignal("mode", "mode", "trace", "mode"),
    WordSignal("contact", "state", "trace", "state"),
    WordSignal("reason", "reason", "trace", "reason"),
    WordSignal("limit", "limit", "trace", "limit"),
    WordSignal("guard", "guard_state", "applied", "guard_state"),
    WordSignal("cause", "cause", "applied", "cause", is_band=False),
    WordSignal("held by", "cause", "applied", "guard_limit", is_band=False),
)
BANDS = [signal for signal in WORD_SIGNALS if signal.is_band]
USUAL = ("drive_force_N", "vibration_velocity_mps", "drive_velocity_mps")  # default figure of a run
_USUAL_OF_IMPORT = ("drive_force_N", "mass_position_m", "drive_position_m", "mass_accel_mps2", "base_accel_mps2")


def named(text: str, run: RunData) -> list[PlottedSignal]:
    """The signals of a comma-separated list; for an empty list the defaults of the log.

    Raises Fault CONFIG for an unknown name, or a signal missing from the log.
    """
    names = list(dict.fromkeys(name.strip() for name in text.split(",") if name.strip()))
    imported = "import" in run.headers
    if not names:
        return [SIGNALS[name] for name in (_USUAL_OF_IMPORT if imported else USUAL) if not imported or holds(run, name)]
    for name in names:
        if name not in SIGNALS:
            raise Fault("CONFIG", f"--signals {name}: unknown signal; known: {', '.join(SIGNALS)}")
        if imported and not holds(run, name):
            present = ", ".join(signal for signal in SIGNALS if holds(run, signal))
            raise Fault("CONFIG", f"--signals {name}: not in {run.path.name}; choose from {present}")
    return [SIGNALS[name] for name in names]


def holds(run: RunData, name: str) -> bool:
    """True if a log contains the signal."""
    signal = SIGNALS[name]
    if signal.topic == "sensors" and name in absent_channels(run.headers, run.path):
        return False
    return len(getattr(run, signal.topic)) > 0


def samples_of(run: RunData, signal: PlottedSignal) -> tuple[Floats, Floats]:
    """Time [s] and values in SI units, [samples]; nan for unknown values."""
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
    """Limits of an axis from the configuration in a log: label and SI value; empty without a configuration."""
    if axis != "amplitude":
        return []
    return stroke_limits({role: run.configuration(role) for role in ("controller", "plant") if role in run.headers})


def stroke_limits(configurations: Mapping[str, Any]) -> list[tuple[str, float]]:
    """Limits of the amplitude from the configurations by role: label and value [m]."""
    limits: dict[float, list[str]] = {}
    for key, words in (
        ("controller.limits.amplitude_max_m", "controller's limit"),
        ("plant.rig.guard.stroke_m", "guard's limit"),
        ("plant.rig.piezo.amplitude_max_m", "exciter's stroke"),
    ):
        if is_number(value := value_at(configurations, key)):
            limits.setdefault(float(value), []).append(words)
    return [(" and ".join(words), value) for value, words in limits.items()]
