"""The measured features of an evidence, and predicted features for any rig numbers, sensor chain and effects."""

import math
import time
from collections import defaultdict
from collections.abc import Mapping, Sequence
from contextlib import suppress
from typing import NamedTuple

import numpy as np
from pydantic import ValidationError

from bridge.arrays import Floats
from diagnosis.deadline import OutOfTimeError
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import Features, Signals, scales_of
from diagnosis.features.force_drive import axis_features
from diagnosis.features.grid import BLOCK_S, averaged, without_vibration
from diagnosis.features.segments import CommandedRun
from diagnosis.features.spring_drive import spring_features
from diagnosis.gap.prepare import Prepared
from diagnosis.model.per_run import in_run, of_run
from diagnosis.model.predict import predict_many
from diagnosis.model.rig import AGE_BEFORE_S, AGE_SPREAD, Effects, Roughness, Start, StartState, rig_config
from diagnosis.model.segment_starts import misread
from diagnosis.model.sensor_chain import (
    ORDINARY,
    SENSOR_EFFECTS,
    SensorChain,
    relative,
    sensed,
    true_commands,
    true_force_N,
)
from diagnosis.threads import each
from plant.config import RigConfig
from plant.effects.library import EFFECTS
from plant.four_rigs_step import LANES, NARROW

AGEING, AGE_BEFORE = "static-friction-ageing", "age_before_s"  # an effect, and the contact's age when a run begins
PIEZO_EFFECTS = frozenset(name for name, effect in EFFECTS.items() if effect.acts_on == "piezo")
# Simulated runs that are kept, of 0.6 MB each. Fewer: trials simulate their common start again. More: memory.
_KEPT = 64


class Point(NamedTuple):
    """A model to evaluate: rig numbers, sensor chain and effects."""

    values: dict[str, float]  # rig numbers by name, only those that differ from the rig table
    chain: SensorChain
    effects: Effects


class Draw(NamedTuple):
    """The random part of one replicate."""

    random: np.random.Generator
    roughness: Roughness


class _Request(NamedTuple):
    """A run of the model to simulate."""

    point: Point
    draw: Draw | None
    effects: Effects  # effects on the rig; sensor effects are applied after the simulation
    start: Start
    entries: tuple[StartState, ...]
    chain: SensorChain


class Problem:
    """A set of runs under one rig table.

    Arrays of features are [features]: the features of all runs, one run after the other; NaN where a run has no such feature.
    """

    def __init__(self, rig: RigTable, runs: list[Prepared], jobs: int = 1) -> None:
        """`jobs`: threads of `predicted_many`, whose result does not depend on them."""
        self.rig = rig
        self.runs = runs
        self.jobs = jobs
        self.until_s = math.inf  # deadline of `predicted_many` by `time.monotonic`
        self.pace = 0.0  # computing time for a simulated second of one lane, from the last batch [s/s]
        self.scales = scales_of(rig)
        longest_m = max(BLOCK_S * float(np.abs(run.commands.drive).sum()) for run in runs)
        self.travel_m = (
            longest_m + self.scales.force_N / self.scales.stiffness_N_per_m
        )  # of the drive; no meaning with force
        self.force_peak_N = max(float(np.abs(run.signals.get("drive_force_N", np.zeros(1))).max()) for run in runs)
        self._simulated: defaultdict[str, dict[object, Signals | None]] = defaultdict(dict)  # by run
        self._averaged = {run.file: averaged(run.commands.frequency_Hz) for run in runs}
        measured = [self._features(run, run.signals) for run in runs]
        self.measured = np.concatenate([np.array(features.values) for features in measured])
        self.labels = [
            (run.file, label) for run, features in zip(runs, measured, strict=True) for label in features.labels
        ]  # file and label of each feature, [features]
        places = [(file, label.segment) for file, label in self.labels]
        numbers = {place: number for number, place in enumerate(dict.fromkeys(places))}
        self.place = np.array([numbers[place] for place in places], np.int64)  # segment of each feature, [features]
        segments = {run.file: run.commands.segments for run in runs}
        self.slips = [segments[file][segment].slips if segment >= 0 else 1 for file, segment in numbers]  # [places]

    def predicted(self, point: Point) -> Floats:
        """Features of the model at `point`, [features]; all NaN where such a rig cannot be simulated."""
        return self.predicted_many([point])[0]

    def predicted_many(
        self, points: Sequence[Point], draws: Sequence[Draw] = (), perhaps: Sequence[Point] = ()
    ) -> list[Floats]:
        """Features of the model at each point, [features] each, in less time than by calls of `predicted`.

        Raises OutOfTimeError where it would end after `until_s`.

        Args:
            points: the models.
            draws: the random part of each point; empty for noise-free predictions.
            perhaps: points that may be requested next, simulated where a lane is free.

        """
        if math.isfinite(self.until_s) and len(points) > LANES:  # the deadline is checked between batches
            batches = [slice(first, first + LANES) for first in range(0, len(points), LANES)]
            return [
                features for batch in batches for features in self.predicted_many(points[batch], draws[batch], perhaps)
            ]
        if not draws:
            of_runs = each(self.jobs, lambda run: self._in_run(run, points, [None] * len(points), perhaps), self.runs)
            return [self._joined(parts) for parts in zip(*of_runs, strict=True)]

        def in_all_runs(numbers: range) -> list[Floats]:
            share, drawn = [points[i] for i in numbers], [draws[i] for i in numbers]
            of_runs = [self._in_run(run, share, drawn, perhaps) for run in self.runs]  # a draw goes on from run to run
            return [self._joined(parts) for parts in zip(*of_runs, strict=True)]

        shares = each(self.jobs, in_all_runs, [range(first, len(points), self.jobs) for first in range(self.jobs)])
        return [shares[number % self.jobs][number // self.jobs] for number in range(len(points))]

    def _in_run(
        self, run: Prepared, points: Sequence[Point], draws: Sequence[Draw | None], perhaps: Sequence[Point]
    ) -> list[Floats]:
        """Features of each point in one run; a single NaN where such a rig cannot be simulated."""
        with np.errstate(over="ignore", invalid="ignore"):  # the model may diverge at the start of a refit
            of_points = self._signals(run, points, draws, perhaps)
            return [
                np.array([math.nan] if signals is None else self._features(run, signals).values)
                for signals in of_points
            ]

    def _joined(self, parts: Sequence[Floats]) -> Floats:
        """Features of all runs [features] from the features of each."""
        features = np.concatenate(parts)
        if len(features) != len(self.measured):
            return np.full(len(self.measured), np.nan)
        with np.errstate(over="ignore"):  # a feature whose square overflows counts as missing
            return np.where(np.isfinite(features * features), features, np.nan)

    def signals(self, run: Prepared, point: Point) -> Signals:
        """Noise-free predicted signals of a run behind its sensors, [blocks] each.

        Raises ValueError when the rig at `point` cannot be simulated.
        """
        (signals,) = self._signals(run, [point], [None])
        if signals is None:
            raise ValueError(f"no rig with these numbers can be simulated: {point}")
        return signals

    def _signals(
        self, run: Prepared, points: Sequence[Point], draws: Sequence[Draw | None], perhaps: Sequence[Point] = ()
    ) -> list[Signals | None]:
        """Signals of each point behind the sensors; None where such a rig cannot be simulated."""
        requests = [_request(run, point, draw) for point, draw in zip(points, draws, strict=True)]
        if self.rig.drive == "force":
            return [self._led_signals(run, request) for request in requests]
        raws = self._raw(run, run.commands, requests, perhaps=perhaps)
        return [
            None if raw is None else _sensor_signals(run, request, raw)
            for request, raw in zip(requests, raws, strict=True)
        ]

    def _led_signals(self, run: Prepared, request: _Request) -> Signals | None:
        """Signals of a point with a force drive, among them the force that makes the model follow the measured motion."""
        effects, draw = request.point.effects, request.draw
        chain = relative(request.point.chain)
        commands = true_commands(run.commands, effects, chain)
        blocks = len(commands.drive)
        noise: Signals = {}
        if draw is not None:
            noise = {name: run.noise.drawn(name, blocks, draw.random) for name in run.signals}
            motion = commands.motion
            if motion is not None and "mass_position_m" in noise:
                motion = motion._replace(position_m=motion.position_m + noise["mass_position_m"])
            # noise on the input force moves the mass, and the force that corrects this motion shows the noise
            commands = commands._replace(drive=commands.drive + noise["drive_force_N"], motion=motion)
        sensors = {name: table for name, table in effects.items() if name in SENSOR_EFFECTS}
        (raw,) = self._raw(run, commands, [request], (chain, _hashable(sensors)))
        if raw is None:
            return None
        result = sensed(raw, commands.frequency_Hz, effects, chain)
        result = {name: result[name] for name in run.signals}
        for name, values in noise.items():
            result[name] = result[name] - values if name == "drive_force_N" else result[name] + values
        return _clipped(run, result)

    def _raw(
        self,
        run: Prepared,
        commands: CommandedRun,
        requests: Sequence[_Request],
        inputs: object = None,
        perhaps: Sequence[Point] = (),
    ) -> list[Signals | None]:
        """Simulated signals of each model, before the sensors; None where such a rig cannot be simulated.

        A run without a draw is cached; a run with a draw is simulated each time.
        """
        keys = [
            number if request.draw is not None else _key(run, request, inputs)
            for number, request in enumerate(requests)
        ]
        kept = self._simulated[run.file]
        cached = {key: kept.pop(key) for key in set(keys) if key in kept}
        todo = {key: request for key, request in zip(keys, requests, strict=True) if key not in cached}
        spare: dict[object, _Request] = {}
        if len(todo) % NARROW:
            soon = [_request(run, point, None) for point in perhaps]
            known = todo.keys() | cached.keys() | kept.keys()
            spare = {key: request for request in soon if (key := _key(run, request, inputs)) not in known}
        simulated = self._simulate(commands, [*todo.values(), *spare.values()], len(todo))
        for key, signals in zip([*todo, *spare], simulated, strict=True):
            if key in todo:
                cached[key] = signals
            elif signals is not None:
                kept[key] = signals
        # The most recently used entries move to the end and are dropped last: the common start of all trials is needed often.
        kept |= {key: cached[key] for key, request in zip(keys, requests, strict=True) if request.draw is None}
        for key in list(kept)[: -max(_KEPT // len(self.runs), 1)]:
            kept.pop(key, None)  # another thread may have dropped it
        return [cached[key] for key in keys]

    def _simulate(self, commands: CommandedRun, requests: Sequence[_Request], wanted: int) -> list[Signals | None]:
        """Signals of each model, before the sensors.

        The first `wanted` are all simulated; None: such a rig cannot be simulated. The others are simulated if a lane is free.
        """
        configs: dict[int, RigConfig] = {}
        for number, request in enumerate(requests):
            with suppress(ValidationError):
                configs[number] = rig_config(
                    self.rig, request.point.values, request.effects, request.draw.roughness if request.draw else None
                )
        starts = [requests[number].start for number in configs]
        entries = [requests[number].entries for number in configs]
        possible = sum(number < wanted for number in configs)
        began = time.monotonic()
        simulated_s = possible * len(commands.drive) * BLOCK_S
        if began + self.pace * simulated_s > self.until_s:
            raise OutOfTimeError
        predicted = predict_many(list(configs.values()), self.rig.drive == "force", commands, starts, entries, possible)
        if possible:
            self.pace = (time.monotonic() - began) / simulated_s
        by_number = dict(zip(configs, predicted, strict=True))
        return [by_number.get(number) for number in range(len(requests))]

    def _features(self, run: Prepared, signals: Signals) -> Features:
        if self.rig.drive == "force":
            return axis_features(signals, run.commands, self.rig)
        return spring_features(without_vibration(signals, self._averaged[run.file]), run.commands, self.scales)


def _request(run: Prepared, point: Point, draw: Draw | None) -> _Request:
    def true_N(reading_N: float, t_s: float) -> float:
        return float(true_force_N(np.array(reading_N), point.effects, np.array(t_s)))

    start = run.start._replace(force_N=true_N(run.start.force_N, 0.0))
    age_s = point.effects.get(AGEING, {}).get(of_run(AGE_BEFORE, run.file))
    if age_s is not None:
        start = start._replace(age_s=float(age_s))
    if draw is not None:
        start = start._replace(age_s=AGE_BEFORE_S * math.exp(AGE_SPREAD * float(draw.random.normal())))
    entries = tuple(
        entry._replace(
            force_N=true_N(entry.force_N, entry.block * BLOCK_S),
            age_s=entry.age_s + start.age_s if entry.from_before and entry.age_s is not None else entry.age_s,
        )
        for entry in run.entries
    )
    chain = point.chain
    if draw is not None:
        # from one piece of track to another
        scale = ORDINARY["position_scale"][1] * float(draw.random.normal())
        chain = chain._replace(position_scale=chain.position_scale + scale)
        entries = tuple(misread(entry, run.noise, draw.random) for entry in entries)
    return _Request(point, draw, _rig_effects(run, point.effects, draw), start, entries, chain)


def _rig_effects(run: Prepared, effects: Effects, draw: Draw | None) -> Effects:
    """The effects on the rig, with their numbers in this run, and with a path for each random effect.

    The path follows from the effect's seed; with seed 0, from the draw. Without seed and draw the effect is left out, as its
    mean is 0. An effect over time has another path in every run, an effect over position the same path in all runs.
    """
    seed = draw.roughness.seed if draw else None
    in_this_run = {name: in_run(table, run.file, run.holdout, seed) for name, table in effects.items()}
    moving = {name: table for name, table in in_this_run.items() if table is not None and name not in SENSOR_EFFECTS}
    if not run.commands.frequency_Hz.any():
        moving = {name: table for name, table in moving.items() if name not in PIEZO_EFFECTS}
    if "before_s" in moving.get("friction-drift", {}):
        moving["friction-drift"] = moving["friction-drift"] | {"before_s": run.before_s}
    result: Effects = {}
    for name, table in moving.items():
        if table["form"] != "random":
            result[name] = table
        elif path := float(table["seed"]) or (1.0 + draw.roughness.seed if draw else 0.0):
            result[name] = table | {"seed": path + (run.before_s if "frequency_Hz" in table else 0.0)}
    return result


def _sensor_signals(run: Prepared, request: _Request, raw: Signals) -> Signals:
    """A simulated run behind its sensors: gains, delays, noise, clipping."""
    result = sensed(raw, run.commands.frequency_Hz, request.point.effects, request.chain)
    result = {name: result[name] for name in run.signals}
    for name in result:
        if name.endswith("shake_mps2"):
            result[name] = np.hypot(result[name], run.noise.shake_mps2[name])
    if request.draw is not None:
        for name, values in result.items():
            result[name] = values + run.noise.drawn(name, len(values), request.draw.random)
    return _clipped(run, result)


def _clipped(run: Prepared, signals: Signals) -> Signals:
    return signals | {name: np.clip(signals[name], *limits) for name, limits in run.clipped.items()}


def _key(run: Prepared, request: _Request, inputs: object) -> object:
    """Key of a run without a draw: all inputs of its simulation."""
    rig = _hashable({"rig": request.point.values})
    return (
        run.file,
        request.start.force_N,
        request.start.age_s,
        request.entries,
        inputs,
        rig,
        _hashable(request.effects),
    )


def _hashable(tables: Mapping[str, Mapping[str, float | str]]) -> object:
    return tuple((name, tuple(sorted(table.items(), key=str))) for name, table in sorted(tables.items()))
