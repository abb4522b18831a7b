"""Rows and columns of the straight lines: the remainder of the described rig in each relation, and the columns of each effect."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np
from scipy.signal import lfilter, savgol_filter

from bench.judge.features import turning_points
from bridge.arrays import Bools, Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared

_WAVES, _BINS = 16, 12  # lengths or frequencies of waves; bins of a free function
_LAGS_S = (3e-4, 8e-4, 2e-3, 5e-3)
Column = tuple[str, Floats, int]  # effect, [rows] or [rows, columns], sign that its first size must have (0: any)


class Block(NamedTuple):
    """One relation: y is explained by nuisances with a prior, then by the columns of one effect."""

    name: str
    y: Floats  # [rows]
    nuisances: Floats  # [rows, nuisances]
    spread: Floats  # standard deviation of each nuisance before the data; infinite: free [nuisances]
    columns: list[Column]
    freed: dict[str, int]  # effects that are a nuisance without its prior: its column
    free: dict[str, Floats]  # variables of free functions, for relations that no effect explains [rows]


class Rows:
    """All runs on the grid of 1 ms, one after the other; arrays are [rows]."""

    def __init__(self, rig: RigTable, runs: list[Prepared]) -> None:
        self.rig, self.runs = rig, runs
        self.window = 2 * max(round(_slip_s(rig) / BLOCK_S / 8), 2) + 1
        lengths = [len(run.commands.drive) for run in runs]
        self.number = np.repeat(np.arange(len(runs)), lengths)
        self._edges = np.cumsum(lengths)[:-1]
        self.t_s = np.concatenate([(np.arange(length) + 0.5) * BLOCK_S for length in lengths])
        self.before_s = np.array([run.before_s for run in runs])[self.number]
        self.command = np.concatenate([run.commands.drive for run in runs])
        self.frequency_Hz = np.concatenate([run.commands.frequency_Hz for run in runs])
        self.force = self.signal("drive_force_N")
        self.stiffness = rig.drive_stiffness_N_per_m or 1.0
        path = self.each(lambda speed: np.cumsum(speed) * BLOCK_S, self.command)
        self.drive = self.signal("drive_position_m") if self.has("drive_position_m") else path
        has_place = self.has("mass_position_m")
        self.place = self.signal("mass_position_m") if has_place else self.drive - self.force / self.stiffness
        self.speed, self.bend = (self.smooth(self.place, order) for order in (1, 2))
        self.accel = self.signal("mass_accel_mps2") if self.has("mass_accel_mps2") else self.bend
        self.off_path = self.drive - path
        inside = np.minimum(self.t_s, self.each(np.flip, self.t_s)) > 0.03
        changes = self.each(lambda speed: np.abs(np.diff(speed, prepend=speed[0])), self.command) > 0.0
        settled = np.convolve(changes, np.ones(201), "same") < 0.5 if rig.drive == "spring" else inside
        self.quiet = inside & settled & (self.frequency_Hz == 0.0)

    def has(self, *names: str) -> bool:
        """Whether every run has these signals."""
        return all(name in run.signals for run in self.runs for name in names)

    def signal(self, name: str) -> Floats:
        """A measured signal of all runs."""
        return np.concatenate([run.signals[name] for run in self.runs])

    def each(self, function: Callable[[Floats], Floats], values: Floats) -> Floats:
        """A function of one run, applied to every run."""
        return np.concatenate([function(part) for part in np.split(values, self._edges)])

    def rate(self, values: Floats) -> Floats:
        """The derivative over time."""
        return self.each(lambda part: np.gradient(part, BLOCK_S), values)

    def smooth(self, values: Floats, order: int = 0) -> Floats:
        """A cubic over an eighth of a slip, or its derivative."""
        return self.each(lambda part: np.asarray(savgol_filter(part, self.window, 3, order, BLOCK_S)), values)


def blocks(rig: RigTable, runs: list[Prepared]) -> Iterator[Block]:
    """The relations that the channels allow."""
    rows = Rows(rig, [run for run in runs if "drive_force_N" in run.signals])
    if rig.drive == "spring" and rows.has("drive_position_m"):
        yield _drive(rows)
        if rows.has("mass_position_m"):
            yield _spring(rows)
    if rows.has("mass_accel_mps2", "mass_position_m"):
        y = rows.smooth(rows.accel) - rows.bend
        nuisances = [(1.0 + 0.0 * y, math.inf), (rows.bend, 8e-3), (rows.rate(rows.bend), 3e-4), (rows.speed, 2.0)]
        gain: list[Column] = [("accelerometer-gain", rows.bend, 0)]
        yield _block("motion", y, nuisances, gain, {}, {"speed": rows.speed}, 5, rows.quiet)
    if rows.has("base_shake_mps2", "base_accel_mps2"):
        yield from _exciter(rows)
        yield _base(rows)
    yield from _friction(rows)


def _spring(rows: Rows) -> Block:
    k, t_s, place = rows.stiffness, rows.t_s, rows.place - rows.place.mean()
    s = rows.drive - rows.place
    s = s + float(np.mean(rows.force / k - s))
    rate, most = rows.rate(s), float(np.abs(s).max())
    known = math.hypot(rows.rig.tolerance.get("drive_stiffness_N_per_m", 1e-3), 4e-3)
    nuisances = [(1.0 + 0.0 * s, math.inf), (k * s, known), (k * place, 8e-3), (k * place**2, 0.3), (k * rate, 1e-4)]
    nuisances.append((k * rows.rate(rate), 5e-8))
    for number, _ in enumerate(rows.runs):
        for waves in (1, 2, 3):
            wander = np.cos(np.pi * waves * t_s / t_s.max()) * (rows.number == number)
            nuisances.append((wander, 4e-4 * rows.rig.static_force_N))
    columns: list[Column] = [("drive-damping", rate, 1), ("drive-hardening", s**3, 1), ("force-sensor-gain", k * s, 0)]
    for lag_s in _LAGS_S:
        low = rows.each(lambda part, lag_s=lag_s: _low_passed(part, lag_s), k * s)
        late = rows.each(lambda part, lag_s=lag_s: np.interp(_index(part) - lag_s / BLOCK_S, _index(part), part), k * s)
        columns += [("force-sensor-lag", low - k * s, 1), ("force-sensor-delay", late - k * s, 1)]
        columns += [("drive-damping", k * s - low, 1)]
    for share in (0.02, 0.06, 0.15):
        columns.append(("drive-backlash", -k * np.clip(s, -share * most, share * most), 1))
    for share in (0.4, 0.6, 0.75):
        columns.append(("drive-hardening", np.sign(s) * np.maximum(np.abs(s) - share * most, 0.0), 1))
    columns += [("force-sensor-drift", t_s, 0), ("force-sensor-drift", np.exp(-t_s / 5.0), 0)]
    columns.append(("frame-compliance", np.stack([-k * s, -k * rows.rate(rate)], axis=1), 1))
    free = {"stretch": s, "place": place, "speed": rate}
    return _block("spring", rows.force - k * s, nuisances, columns, {"drive-stiffness": 1}, free, 5)


def _drive(rows: Rows) -> Block:
    nuisances: list[tuple[Floats, float]] = []
    used = np.zeros(len(rows.t_s), bool)
    for number, run in enumerate(rows.runs):
        for segment in run.commands.segments:
            at = np.flatnonzero(rows.number == number)[segment.first : segment.last]
            for power in range(3):
                inside = np.zeros(len(used))
                inside[at] = np.linspace(-1.0, 1.0, len(at)) ** power
                nuisances.append((inside, math.inf))
            used[at] = True
    ripple: list[Column] = [("drive-speed-ripple", waves, 0) for waves in _waves(rows.drive, 0.02, 0.5)]
    ripple += [("drive-speed-ripple", waves, 0) for waves in _waves(rows.t_s, 0.008, 0.1)]
    return _block("drive", rows.off_path, nuisances, ripple, {}, {}, 5, used)


def _exciter(rows: Rows) -> Iterator[Block]:
    table: list[tuple[float, float, float, float]] = []
    for run in rows.runs:
        for segment in run.commands.segments:
            commanded = segment.amplitude_m * (2.0 * np.pi * segment.frequency_Hz) ** 2 / math.sqrt(2.0)
            for first in range(segment.first, segment.last - 50, 50) if segment.frequency_Hz else ():
                at = slice(first, first + 50)
                shake = max(float(run.signals["base_shake_mps2"][at].mean()), 1e-9)
                heated_s = float(np.count_nonzero(run.commands.amplitude_m[:first])) * BLOCK_S
                load_N = float(np.abs(run.signals["drive_force_N"][at]).mean())
                table.append((math.log(shake / commanded), segment.frequency_Hz, load_N, heated_s))
    if len(table) < 20:
        return
    y, f_Hz, load_N, heated_s = np.array(table).T
    columns: list[Column] = [("piezo-sag", -load_N / load_N.mean(), 1), ("accelerometer-gain", 1.0 + 0.0 * y, 0)]
    columns += [("piezo-sag", np.exp(-heated_s / settles_s) - 1.0, 1) for settles_s in (1.0, 3.0)]
    for corner_Hz in (2500.0, 4000.0, 6500.0, 1e4):
        columns += [("piezo-roll-off", -order * np.log1p((f_Hz / corner_Hz) ** 2), 1) for order in (0.5, 1.0)]
    for mode_Hz in (3300.0, 3700.0, 4100.0, 5200.0, 6000.0, 7500.0, 1e4):
        square = (f_Hz / mode_Hz) ** 2
        columns.append(("piezo-resonance", np.log(np.abs(1.0 + 0.25 * square / (1.0 - square + 0.1j))), 1))
    yield _block("exciter", y, [(1.0 + 0.0 * y, 0.012), ((f_Hz / 1e4) ** 2, 0.6)], columns, {}, {}, 1)


def _base(rows: Rows) -> Block:
    """The slow acceleration of the base, against a mode that the friction drives."""
    friction = rows.each(
        lambda part: np.convolve(part, np.full(5, 0.2), "same"), rows.force - rows.rig.mass_kg * rows.accel
    )
    columns: list[Column] = []
    for mode_Hz in np.geomspace(60.0, 400.0, 12).tolist():
        poles = np.poly(np.exp(2.0 * np.pi * mode_Hz * BLOCK_S * np.array([-0.03 + 1j, -0.03 - 1j]))).real
        rung = rows.each(lambda part, poles=poles: np.asarray(lfilter([1.0, -2.0, 1.0], poles, part)), friction)
        columns.append(("base-compliance", rung, 0))
    y = rows.signal("base_accel_mps2")
    return _block("base", y, [(1.0 + 0.0 * y, math.inf)], columns, {}, {}, 1, rows.quiet)


def _friction(rows: Rows) -> Iterator[Block]:
    rig, tolerance = rows.rig, rows.rig.tolerance
    f_c, f_s, v_s = rig.coulomb_force_N, rig.static_force_N, rig.stribeck_velocity_mps
    known_c, known_s = (tolerance.get(f"{name}_force_N", 0.0) + 1e-4 for name in ("coulomb", "static"))
    slides = rows.quiet & (np.abs(rows.speed) > 0.7 * v_s)
    if np.count_nonzero(slides) > 200:
        v, a = rows.speed[slides], rows.accel[slides]
        share, side = np.exp(-((v / v_s) ** 2)), np.sign(v)
        law = f_c + (f_s - f_c) * share + rig.viscous_damping_Ns_per_m * np.abs(v)
        steep = -2.0 * (v / v_s) ** 2 * share * (f_s - f_c)  # over the logarithm of the speed
        viscous = tolerance.get("viscous_damping_Ns_per_m", 0.0) * rig.viscous_damping_Ns_per_m + 1e-9
        known_v = tolerance.get("stribeck_velocity_mps", 0.0) + 0.1
        nuisances = [(f_c * (1 - share), known_c), (f_s * share, known_s), (steep, known_v), (np.abs(v), viscous)]
        columns: list[Column] = [("viscous-friction", np.abs(v), 1), ("viscous-friction", v * v, 1)]
        columns.append(("frictional-lag", steep * a / np.where(np.abs(v) > 0.1 * v_s, v, v_s), -1))
        columns += _on_friction(rows, slides, law, side)
        freed = {"coulomb-level": 0, "static-level": 1, "stribeck-velocity": 2}
        y = (rows.force - rig.mass_kg * rows.accel)[slides] * side - law
        yield _block("sliding", y, nuisances, columns, freed, {"place": rows.place[slides]}, 4)
    peaks = np.zeros(len(slides), bool)
    dwell_s = np.zeros(len(slides))
    for number, _ in enumerate(rows.runs):
        at = np.flatnonzero(rows.number == number)
        highs, lows = turning_points(np.abs(rows.force[at]), 0.35 * (f_s - f_c))
        highs = at[highs[1 : len(lows) + 1]]
        dwell_s[highs] = BLOCK_S * (highs - at[lows[: len(highs)]])
        peaks[highs] = rows.quiet[highs]
    if np.count_nonzero(peaks) > 12:
        waits, commands = dwell_s[peaks], rows.command[peaks]
        # the median of a speed, as a breakaway that is late is also high
        ages = np.log([max(float(np.median(waits[commands == command])), 1e-3) for command in commands])
        level = np.full(len(ages), f_s)
        columns = [("static-friction-ageing", ages - ages.mean(), 1)]
        columns += _on_friction(rows, peaks, level, np.sign(rows.force[peaks]))
        y = np.abs(rows.force[peaks]) - f_s
        yield _block("breakaway", y, [(level, known_s)], columns, {"static-level": 0}, {}, 1)


def _on_friction(rows: Rows, at: Bools, law: Floats, side: Floats) -> Iterator[Column]:
    """Columns that scale the friction at these rows: place, load, time, direction; and the sensor's gain, zero and drift."""
    t_s, session_s = rows.t_s[at], (rows.t_s + rows.before_s)[at]
    yield from (("position-dependent-friction", law[:, None] * waves, 0) for waves in _waves(rows.place[at], 0.03, 0.6))
    in_run = law[:, None] * np.eye(len(rows.runs))[rows.number[at]]  # a load has another phase in each run
    for waves in _waves(t_s, 0.008, 0.2):
        yield "normal-load-fluctuation", np.concatenate([in_run * wave[:, None] for wave in waves.T], axis=1), 0
    for course in (t_s, session_s, np.exp(-session_s / 10.0)):
        yield "friction-drift", law * course, 0
    yield "force-sensor-drift", side * t_s, 0
    yield "direction-dependent-friction", law * side, 0
    yield "force-sensor-bias", side * rows.rig.static_force_N, 0
    yield "force-sensor-gain", law, 0


def _block(
    name: str, y: Floats, nuisances: list[tuple[Floats, float]], columns: list[Column],
    freed: dict[str, int], free: dict[str, Floats], count: int, keep: Bools | None = None,
) -> Block:  # fmt: skip
    """The block on means over `count` rows, of the rows that are kept."""
    whole = len(y) // count * count
    kept = slice(None) if keep is None else keep[:whole].reshape(-1, count).all(axis=1)

    def mean(values: Floats) -> Floats:
        return values[:whole].reshape(-1, count, *values.shape[1:]).mean(axis=1)[kept]

    thinner = [(effect, mean(values.reshape(len(y), -1)), sign) for effect, values, sign in columns]
    spread = np.array([deviation for _, deviation in nuisances])
    steady = mean(np.stack([values for values, _ in nuisances], axis=1))
    return Block(name, mean(y), steady, spread, thinner, freed, {key: mean(values) for key, values in free.items()})


def binned(values: Floats) -> Floats:
    """Indicators of equally filled bins, [rows, bins]."""
    edges = np.quantile(values, np.linspace(0.0, 1.0, _BINS + 1)[1:-1])
    return np.eye(_BINS)[np.searchsorted(edges, values)]


def _slip_s(rig: RigTable) -> float:
    return math.pi * math.sqrt(rig.mass_kg / rig.drive_stiffness_N_per_m) if rig.drive_stiffness_N_per_m else 0.1


def _waves(over: Floats, low: float, high: float) -> list[Floats]:
    """Sine and cosine over a variable, of lengths from `low` to `high` of its span, [rows, 2] each."""
    angles = [2.0 * np.pi * over / length for length in np.geomspace(low, high, _WAVES) * max(np.ptp(over), 1e-12)]
    return [np.stack([np.sin(angle), np.cos(angle)], axis=1) for angle in angles]


def _index(values: Floats) -> Floats:
    return np.arange(len(values), dtype=np.float64)


def _low_passed(values: Floats, lag_s: float) -> Floats:
    keep = math.exp(-BLOCK_S / lag_s)
    return np.asarray(lfilter([1.0 - keep], [1.0, -keep], values - values[0])) + values[0]
