"""The rig to predict: its numbers, its effects, its start, its surface."""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Records
from diagnosis.evidence.manifest import RigTable, rig_file_tables
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.segments import CommandedRun
from plant.config import RigConfig
from plant.effects.drive import even_m, extension_m
from plant.records import build

Effects = dict[str, dict[str, float | str]]
# Age of the contact when a run begins, and the standard deviation of its logarithm in replicates: three standard deviations
# reach from 0.1 s to a quarter of an hour. A smaller spread makes the first breakaway a gap; a larger spread hides ageing.
AGE_BEFORE_S, AGE_SPREAD = 10.0, 1.5
# Longest step without vibration. Larger: features change. Smaller: only slower. Counted: docs/method/diagnosis.md.
_COARSEST_STEP_S = 7e-5
# Steps in a period of the vibration. Fewer: features change. More: only slower. Counted: docs/method/diagnosis.md.
_STEPS_PER_PERIOD = 16
_CONTACT_STEP = 0.5  # longest stable step, times the natural frequency [rad/s] of the mass on the contact
_LED_STEP_S = 1e-4  # longest step with a force drive: features differ by 1e-3 N from those at 10 us


class Start(NamedTuple):
    """State of the rig at the first block, where the time of the model begins."""

    force_N: float  # force in the drive's spring; with a force drive, in the contact
    position_m: float
    velocity_mps: float = 0.0
    age_s: float = AGE_BEFORE_S  # age of the contact
    # position by the drive's sensor, whose zero differs from the zero of the slide's sensor
    drive_m: float | None = None


class StartState(NamedTuple):
    """State of the rig at the start of a segment."""

    block: int
    force_N: float  # force in the drive's spring
    age_s: float | None  # age of the contact; None: the slide is sliding
    from_before: bool = False  # whether the slide has stuck since before the run, so that the age at its start is added


class Rig(NamedTuple):
    """Records for the plant's kernel."""

    params: Records  # [1]
    state: Records  # [1], at the start of the run
    steps: npt.NDArray[np.int64]  # steps in each block, [blocks]


class Roughness(NamedTuple):
    """A rough surface."""

    ratio: float  # scatter of the friction along the track, as a share of the friction
    length_m: float  # correlation length of the friction
    seed: int


def rig_config(rig: RigTable, values: dict[str, float], effects: Effects, roughness: Roughness | None) -> RigConfig:
    """The plant's configuration for a rig table, with `values` in place of the described numbers.

    Raises pydantic.ValidationError when the plant cannot simulate such a rig.
    """
    table: dict[str, Any] = {**rig_file_tables(rig.values() | values), "effects": effects}
    if roughness is not None:
        table["contact"] |= {
            "roughness_ratio": roughness.ratio,
            "roughness_length_m": roughness.length_m,
            "roughness_seed": roughness.seed,
        }
    # the exciter of the model follows its command at once and without limit; any deviation from this is a gap
    table["piezo"] = {"amplitude_max_m": 1e-3, "amplitude_slew_m_per_s": 0.0}
    return RigConfig.model_validate(table)


def built(config: RigConfig, force_driven: bool, commands: CommandedRun, start: Start) -> Rig:
    """Kernel records of a rig at the start of a run, and the number of steps in each of its blocks."""
    params, state = build(config)
    p: Any = params[0]
    p.force_keep = p.accel_keep = p.position_keep = 0.0
    p.accel_highpass_keep = 1.0
    p.frequency_min_Hz, p.frequency_max_Hz = 1.0, 1e9
    p.force_driven = force_driven
    p.disturbed = p.disturbed or force_driven
    s: Any = state[0]
    held_N = float(np.clip(start.force_N, -p.F_s, p.F_s))
    s.x, s.v = start.position_m, start.velocity_mps
    s.z = held_N / p.k_t
    s.age_s = start.age_s
    if not force_driven:
        s.s_d = start.position_m + extension_m(p, held_N)
        s.drive_N = held_N
        s.frame_m = held_N * p.frame_m_per_N
        s.base_m = held_N * p.base_m_per_N
        s.s_d += s.frame_m
        s.even_m = s.s_d
        if start.drive_m is not None and p.ripple_wavelength_m > 0.0:
            p.ripple_phase_rad += 2.0 * math.pi * (even_m(p, start.drive_m) - s.s_d) / p.ripple_wavelength_m
    contact_rad_per_s = math.sqrt(p.k_t / p.m)
    coarsest_s = min(_LED_STEP_S if force_driven else _COARSEST_STEP_S, _CONTACT_STEP / contact_rad_per_s)
    if p.base_m_per_N > 0.0:  # the contact spring between slide and base is stable up to twice this step
        base_kg = 1.0 / (p.base_m_per_N * (2.0 * math.pi * p.base_Hz) ** 2)
        coarsest_s = min(coarsest_s, math.sqrt(base_kg / p.k_t))
    steps = np.maximum(
        math.ceil(BLOCK_S / coarsest_s - 1e-9),
        np.ceil(_STEPS_PER_PERIOD * commands.frequency_Hz * BLOCK_S - 1e-9),
    ).astype(np.int64)
    return Rig(params, state, steps)
