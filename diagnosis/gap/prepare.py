"""Preparation of measured runs for the comparison: the 1 ms grid, segments, noise, and the start state of each segment."""

from typing import NamedTuple

import numpy as np

from bridge.faults import Fault
from diagnosis.evidence.folder import Evidence, MeasuredRun
from diagnosis.evidence.manifest import RigTable
from diagnosis.features.feature import Signals, scales_of
from diagnosis.features.force_drive import moving_s
from diagnosis.features.grid import BLOCK_S, SHAKEN, averaged, block_means, reduce_run, without_vibration
from diagnosis.features.noise import RunNoise, noise_of
from diagnosis.features.segments import CommandedRun, commands_of
from diagnosis.features.slips import settled
from diagnosis.model.predict import predict
from diagnosis.model.rig import Start, StartState, rig_config
from diagnosis.model.segment_starts import entries_of

# Shortest time in which an axis moves in a run. Too small: the mean friction is noise. Too large: short strokes are refused.
_SHORTEST_MOTION_S = 0.5
_BESIDE = ("normal_load_N", "other_force_N")


class Prepared(NamedTuple):
    """A run, ready for comparison. Signals are [blocks of 1 ms] each."""

    file: str
    holdout: bool  # whether the run is held out: not fitted, only predicted
    signals: Signals
    commands: CommandedRun
    start: Start
    entries: tuple[StartState, ...]  # state at the start of each segment, with the measured force
    before_s: float  # total duration of the runs before this run, in the manifest's order
    noise: RunNoise
    clipped: dict[str, tuple[float, float]]  # lowest and highest value that the sensor can show, by signal
    beside: Signals = {}  # measured channels that no model predicts: normal load, another force


def prepare(evidence: Evidence) -> list[Prepared]:
    """Reduce every run and find its commands, start and noise; runs in the manifest's order.

    Raises Fault BAD_EVIDENCE when a force-driven axis moves for less than 0.5 s.
    """
    prepared: list[Prepared] = []
    for run in evidence.runs:
        before_s = prepared[-1].before_s + len(prepared[-1].commands.drive) * BLOCK_S if prepared else 0.0
        prepared.append(_prepare(evidence.rig, run, before_s))
    return prepared


def _prepare(rig: RigTable, run: MeasuredRun, before_s: float) -> Prepared:
    signals = reduce_run(run)
    for shake, source in SHAKEN.items():  # a model is clipped in its block means only, so its vibration would differ
        if source in run.clipped:
            signals.pop(shake, None)
    commands = commands_of(run, rig, signals)
    if rig.drive == "spring":
        scales = scales_of(rig)
        commands = commands._replace(segments=tuple(settled(signals, segment, scales) for segment in commands.segments))
    if commands.motion is not None and (seconds := moving_s(commands.motion, rig)) < _SHORTEST_MOTION_S:
        channel = "mass_position_m" if "mass_position_m" in signals else "mass_accel_mps2"
        line = (
            f"{run.file}: {channel}: moves for {seconds:.3g} s: must be {_SHORTEST_MOTION_S:g} s at "
            f"least, as a shorter motion shows no friction; leave the run out, or check channels.{channel}.scale"
        )
        raise Fault("BAD_EVIDENCE", line)
    start = _start(rig, signals, commands)
    noisy = without_vibration(signals, averaged(commands.frequency_Hz))
    if commands.motion is not None and "mass_position_m" in signals:
        led = predict(rig_config(rig, {}, {}, None), True, commands, start)
        noisy = signals | {"mass_position_m": signals["mass_position_m"] - led["mass_position_m"]}
    noise = noise_of(noisy, commands, scales_of(rig))
    clipped = {name: limits for name, limits in run.clipped.items() if name in signals}
    entries = entries_of(signals, commands, scales_of(rig))
    return Prepared(
        run.file, run.holdout, signals, commands, start, entries, before_s, noise, clipped, block_means(run, _BESIDE)
    )


def _start(rig: RigTable, signals: Signals, commands: CommandedRun) -> Start:
    force_N, slide_m, drive_m = (
        float(signals[name][:10].mean()) if name in signals else None
        for name in ("drive_force_N", "mass_position_m", "drive_position_m")
    )
    if rig.drive == "force":
        assert commands.motion is not None, "a force drive has a motion"  # noqa: S101
        at_m, velocity_mps = (float(values[0]) for values in commands.motion[:2])
        # friction at the start: sliding friction, or the force that the contact holds at rest
        sliding = abs(velocity_mps) > rig.stribeck_velocity_mps
        return Start(np.sign(velocity_mps) * rig.coulomb_force_N if sliding else force_N or 0.0, at_m, velocity_mps)
    force_N = 0.7 * rig.coulomb_force_N if force_N is None else force_N
    if slide_m is None:
        slide_m = 0.0 if drive_m is None else drive_m - force_N / scales_of(rig).stiffness_N_per_m
    return Start(force_N, slide_m, drive_m=drive_m)
