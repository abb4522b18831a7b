"""Made runs whose motion is drawn, not simulated: sticks and slips under a spring, with known noise."""

from collections.abc import Callable

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.noise import RunNoise
from diagnosis.features.segments import CommandedRun, Segment
from diagnosis.gap.prepare import Prepared
from diagnosis.model.rig import Start

STIFFNESS_N_PER_M, MASS_KG, SLIP_S = 11700.0, 1.5, 0.036
NOISE_N, NOISE_m, NOISE_mps2 = 6e-3, 3e-8, 3e-3
BLOCK_S = 1e-3
Signals = dict[str, np.ndarray]


def rig(described_N_per_m: float = STIFFNESS_N_PER_M, tolerance: float = 0.02) -> RigTable:
    """The paper's rig with another described stiffness."""
    return RigTable(
        drive="spring", mass_kg=MASS_KG, drive_stiffness_N_per_m=described_N_per_m, drive_damping_Ns_per_m=0.0,
        contact_stiffness_N_per_m=77.52e6, contact_damping_Ns_per_m=2.15e4, viscous_damping_Ns_per_m=0.0,
        coulomb_force_N=14.49, static_force_N=17.38, stribeck_velocity_mps=5e-4,
        tolerance={"drive_stiffness_N_per_m": tolerance},
    )  # fmt: skip


def runs(cause: Callable[[int, Signals], None] | None = None, count: int = 3, seed: int = 1) -> list[Prepared]:
    """Runs of 8 s at different speeds, the last held out; `cause` changes the true signals of a run, before the noise."""
    return [_run(number, number == count - 1, cause, seed) for number in range(count)]


def _run(number: int, holdout: bool, cause: Callable[[int, Signals], None] | None, seed: int) -> Prepared:
    random = np.random.default_rng([seed, number])
    blocks = 8000
    speed_mps = (1e-3, 2e-3, 1.5e-3)[number % 3]
    t_s = (np.arange(blocks) + 0.5) * BLOCK_S
    travel_m = speed_mps * t_s
    slide_m, accel_mps2 = np.zeros(blocks), np.zeros(blocks)
    begin_s = 0.3
    while begin_s < t_s[-1]:
        step_m = 3e-4 * random.uniform(0.8, 1.2)
        phase = np.clip((t_s - begin_s) / SLIP_S, 0.0, 1.0)
        slide_m += step_m * 0.5 * (1.0 - np.cos(np.pi * phase))
        moving = (phase > 0.0) & (phase < 1.0)
        accel_mps2 += moving * step_m * 0.5 * (np.pi / SLIP_S) ** 2 * np.cos(np.pi * phase)
        begin_s += step_m / speed_mps
    frequency_Hz = np.where(t_s > 4.0, (3000.0, 2000.0, 2500.0)[number % 3], 0.0)
    shaken_mps2 = (
        (2.0 * np.pi * frequency_Hz) ** 2 * 2e-8 / np.sqrt(2.0) / np.sqrt(1.0 + 0.5 * (frequency_Hz / 1e4) ** 2)
    )
    signals = {
        "drive_force_N": STIFFNESS_N_PER_M * (travel_m - slide_m + 9e-4),
        "mass_accel_mps2": accel_mps2,
        "base_accel_mps2": np.zeros(blocks),
        "mass_position_m": slide_m + 0.01,
        "drive_position_m": travel_m + 0.01,
        "base_shake_mps2": shaken_mps2,
    }
    if cause is not None:
        cause(number, signals)
    sizes = {"drive_force_N": NOISE_N, "mass_position_m": NOISE_m, "drive_position_m": NOISE_m}
    for name, values in signals.items():
        signals[name] = values + sizes.get(name, NOISE_mps2) * random.standard_normal(blocks)
    on = frequency_Hz > 0.0
    segments = (
        Segment(100, int(np.argmax(on)), speed_mps, 0.0, 0.0),
        Segment(int(np.argmax(on)) + 100, blocks, speed_mps, float(frequency_Hz[-1]), 2e-8),
    )
    commands = CommandedRun(np.full(blocks, speed_mps), frequency_Hz, np.where(on, 2e-8, 0.0), segments)
    noise = RunNoise({}, {"base_shake_mps2": NOISE_mps2}, 5e-3)
    return Prepared(
        f"run-{number + 1:02d}.csv", holdout, signals, commands, Start(10.0, 0.01), (), 8.0 * number, noise, {}
    )


def in_units(rig: RigTable, runs: list[Prepared], lengths: float, forces: float) -> tuple[RigTable, list[Prepared]]:
    """The same rig and runs with every length and every force multiplied: a rotary record is one in rad and N m."""
    powers = {"coulomb_force_N": (1, 0), "static_force_N": (1, 0), "stribeck_velocity_mps": (0, 1)}
    numbers = {
        name: value * forces ** powers.get(name, (1, -1))[0] * lengths ** powers.get(name, (1, -1))[1]
        for name, value in rig.values().items()
        if value is not None
    }
    return rig.model_copy(update=numbers), [_in_units(run, lengths, forces) for run in runs]


def _in_units(run: Prepared, lengths: float, forces: float) -> Prepared:
    commands = run.commands
    segments = tuple(
        segment._replace(
            drive_velocity_mps=segment.drive_velocity_mps * lengths, amplitude_m=segment.amplitude_m * lengths
        )
        for segment in commands.segments
    )
    return run._replace(
        signals={name: values * (forces if name.endswith("_N") else lengths) for name, values in run.signals.items()},
        commands=commands._replace(
            drive=commands.drive * lengths, amplitude_m=commands.amplitude_m * lengths, segments=segments
        ),
        noise=run.noise._replace(
            shake_mps2={name: value * lengths for name, value in run.noise.shake_mps2.items()},
            slow_force_N=run.noise.slow_force_N * forces,
        ),
    )
