"""One simulated run of a rig, as the bench's sensors record it."""

from typing import Any

import numpy as np

from bridge.wire.channels import CHANNELS
from plant.effects.drive import even_m, extension_m
from plant.records import TRUTH, build
from plant.simulate import run_blocks
from tests.blind.workshop.campaigns import Run
from tests.blind.workshop.outside import ACTORS, Actor, Moment, hysteresis_N
from tests.blind.workshop.rigs import Rig
from tests.blind.workshop.sizes import SIZES, Drawn, of_library

_MAINS_HZ = 50.0


def measure(rig: Rig, run: Run, effects: tuple[Drawn, ...], seed: list[int]) -> dict[str, np.ndarray]:
    """Columns of a run with effects; `seed` starts its noise and its random events."""
    present = [effect for effect in effects if effect.strength > 0.0]
    config = rig.config({e.name: of_library(e, rig, run.begun_s) for e in present if e.name in SIZES})
    others = {effect.name: effect.values(rig.units) for effect in present if effect.name not in SIZES}
    params, state = build(config)
    p: Any = params[0]
    if "loose-payload" in others:
        others["loose-payload"]["mass_kg"] = p.m * others["loose-payload"]["mass_share"]
        p.m -= others["loose-payload"]["mass_kg"]
    events = np.random.default_rng([*seed, 1])
    actors = [ACTORS[name](n, p.F_s, run.start_m, events) for name, n in others.items() if name in ACTORS]
    _begin(p, state[0], run)
    analogue = _simulate(rig, run, params, state, actors)
    if "force-cell-hysteresis" in others:
        analogue[0] = hysteresis_N(others["force-cell-hysteresis"], analogue[0])
    t_s = (np.arange(analogue.shape[1]) + 1) * (rig.block_s / rig.samples_per_block)
    readings = _readings(rig, t_s, analogue, np.random.default_rng([*seed, 0]))
    vibration = (
        np.repeat(command, rig.samples_per_block) for command in run.commands(rig.begins_s(run.duration_s))[1:]
    )
    names = ("vibration_frequency_Hz", "vibration_amplitude_m")
    return {"t_s": t_s, **readings, **dict(zip(names, vibration, strict=True))}


def _begin(p: Any, s: Any, run: Run) -> None:
    """The slide rests at its place, with a force in the spring."""
    force_N = run.start_share * p.F_s
    s.frame_m, s.base_m = force_N * p.frame_m_per_N, force_N * p.base_m_per_N
    s.x = s.mass_position_f = run.start_m
    s.s_d = s.drive_position_f = s.x + s.frame_m + extension_m(p, force_N)
    s.even_m = even_m(p, s.s_d)
    s.drive_N = s.force_f = force_N
    s.force_lag[:], s.delay_line[:] = force_N, force_N
    s.z, s.age_s = force_N / p.k_t, run.rested_s


def _simulate(rig: Rig, run: Run, params: Any, state: Any, actors: list[Actor]) -> np.ndarray:
    """The five signals before noise, [5, samples]."""
    p, length_s, samples = params[0], rig.block_s, rig.samples_per_block
    begins_s = rig.begins_s(run.duration_s)
    drive_mps, frequency_Hz, amplitude_m = run.commands(begins_s)
    blocks = len(begins_s)
    analogue, truth = (np.empty((len(rows), blocks * samples)) for rows in (CHANNELS, TRUTH))
    if not actors:
        run_blocks(params, state, drive_mps, frequency_Hz, amplitude_m, analogue, truth)
        return analogue
    signals, hidden = (np.empty((len(rows), samples)) for rows in (CHANNELS, TRUTH))
    # views of one number each: an attribute of a record takes ten times as long, which would double the time of a run
    x, v, s_d, drive_N = (state[name] for name in ("x", "v", "s_d", "drive_N"))
    F_c, F_s = params["F_c"], params["F_s"]
    k_d, kept_N = float(p.k_d), bool(p.disturbed)
    nominal_N = float(p.F_c), float(p.F_s)
    push_N = np.zeros(blocks + 1)  # at the ends of the blocks, after its value at the start
    before = Moment(0.0, 0.0, x[0], v[0], drive_N[0], drive_mps[0])
    for act in actors:
        act(before)
    push_N[0] = before.push_N
    # A force on the slide is a drive that is further on by force / stiffness, and whose readings lack this part.
    s_d[0] += push_N[0] / k_d
    for i, t_s in enumerate(begins_s.tolist()):
        pull_N = (drive_N[0] if kept_N else k_d * (s_d[0] - x[0])) - push_N[i]
        now = Moment(t_s, length_s, x[0] + length_s * v[0], v[0], pull_N, drive_mps[i], amplitude_m[i])
        for act in actors:
            act(now)
        push_N[i + 1] = now.push_N
        F_c[0], F_s[0] = now.level * nominal_N[0], now.level * nominal_N[1]
        speed_mps = now.drive_mps + (push_N[i + 1] - push_N[i]) / (k_d * length_s)
        run_blocks(
            params, state, np.array([speed_mps]), frequency_Hz[i : i + 1], np.array([now.amplitude_m]), signals, hidden
        )
        analogue[:, i * samples : (i + 1) * samples] = signals
    push_N = np.interp(np.arange(blocks * samples) + 1.0, np.arange(blocks + 1) * samples, push_N)
    analogue[0] -= (1.0 + p.force_ratio) * push_N
    analogue[4] -= push_N / k_d
    return analogue


def _readings(rig: Rig, t_s: np.ndarray, analogue: np.ndarray, random: np.random.Generator) -> dict[str, np.ndarray]:
    """The signals after gain, delay, hum, noise and converter."""
    c = rig.sensors
    force_N, mass_mps2, base_mps2, mass_m, drive_m = analogue
    noise = random.standard_normal(analogue.shape)
    hum_N = c["force_hum_N"] * np.sin(2.0 * np.pi * _MAINS_HZ * t_s + random.uniform(0.0, 6.28))
    force_N = c["force_gain"] * np.interp(t_s - c["force_late_s"], t_s, force_N) + c["force_zero_N"] + hum_N
    accel_mps2, position_m = c["accel_noise_mps2"], c["position_noise_m"]
    return {
        "drive_force_N": _converted(force_N + c["force_noise_N"] * noise[0], c["force_step_N"]),
        "mass_accel_mps2": _converted(c["accel_gain"] * mass_mps2 + accel_mps2 * noise[1], c["accel_step_mps2"]),
        "base_accel_mps2": _converted(c["accel_gain"] * base_mps2 + accel_mps2 * noise[2], c["accel_step_mps2"]),
        "mass_position_m": _converted(mass_m + position_m * noise[3], c["position_step_m"]),
        "drive_position_m": _converted(drive_m + position_m * noise[4], c["position_step_m"]),
    }


def _converted(signal: np.ndarray, step: float) -> np.ndarray:
    return np.round(signal / step) * step
