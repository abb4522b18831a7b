"""The model beside the rig: one run predicted under the run's own commands, reduced to the 1 ms grid.

The equations are the plant's own: with a force drive in its kernel, with a spring in `side_by_side`, many rigs at once. Its
sensors' bandwidths are opened wide, since a manifest states none. Without vibration 70 us a step are enough: no feature differs
by a third of a floor from 10 us (tests/truth/test_gap.py). With it, 16 steps a period: as near to 60 as 20 are (0.35 floors rms,
as the phase decides when a slip comes), 14 are further (0.58).

Every segment begins with the force that was measured there. In what phase of its cycle the slide is when the vibration changes is
chance; it decides for seconds how the force settles where nothing slips any more, and how many slips a segment has.
"""

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.kernel import Record, kernel
from bridge.messages import CHANNELS
from diagnosis.commands import Commands
from diagnosis.lanes import LANES
from diagnosis.manifest import RigTable
from diagnosis.reduced import BLOCK_S, SIGNALS
from diagnosis.side_by_side import advance_lanes
from plant.config import RigConfig
from plant.core import advance_disturbed
from plant.disturb import even_m, extension_m
from plant.records import TRUTH, build

Floats = npt.NDArray[np.floating[Any]]
Effects = dict[str, dict[str, float | str]]
# How old a contact is when a run begins, and the spread of its logarithm: from a stick that was under way to a quarter of an hour
AGE_BEFORE_S, AGE_SPREAD = 10.0, 1.5
_COARSEST_STEP_S = 7e-5
_STEPS_PER_PERIOD = 16
_CONTACT_STEP = 0.5  # of 1 / natural frequency of the mass on the contact stiffness
# A force-driven model is held to the measured motion by a spring and a damper: this natural frequency, damped critically. Faster
# follows the noise of the encoder, slower smears a reversal: errors of the friction show up to 10 Hz.
_HOLDING_RAD_PER_S = 2.0 * math.pi * 10.0
_RATE_FILTER_S = 3e-3  # of the damper: keeps 0.1 um of encoder noise to 0.2 N, turns the phase at 10 Hz by 11 degrees
_LED_STEP_S = 1e-4  # its features are equal to 1e-3 N to those at 10 us


class Start(NamedTuple):
    """State of the rig at the first block; time counts from there, whatever the clock of the log says."""

    force_N: float  # in the drive, spring-driven; in the contact otherwise
    position_m: float
    velocity_mps: float = 0.0
    age_s: float = AGE_BEFORE_S
    drive_m: float | None = None  # as the drive's own sensor has it, whose zero is not that of the slide's


class Entry(NamedTuple):
    """How a segment begins."""

    block: int
    force_N: float  # in the drive's spring
    age_s: float | None  # of the contact, where the slide sticks; None: it slides on
    from_before: bool = False  # it has stuck since before the run began: the age at the start comes on top


class Rig(NamedTuple):
    """Parameters and state at the start, as the plant's kernel wants them, and steps in every block."""

    params: npt.NDArray[Any]
    state: npt.NDArray[Any]
    steps: npt.NDArray[np.int64]


class Roughness(NamedTuple):
    """A rough surface, one of many by its seed."""

    ratio: float
    length_m: float
    seed: int


def rig_config(rig: RigTable, values: dict[str, float], effects: Effects, roughness: Roughness | None) -> RigConfig:
    """The plant's configuration for a described rig with `values` in place of the described ones."""
    value = {name: known for name, known in rig.values().items() if known is not None} | values
    contact: dict[str, Any] = {
        "stiffness_N_per_m": value["contact_stiffness_N_per_m"],
        "damping_Ns_per_m": value["contact_damping_Ns_per_m"],
        "viscous_damping_Ns_per_m": value["viscous_damping_Ns_per_m"],
        "coulomb_force_N": value["coulomb_force_N"],
        "static_force_N": max(value["static_force_N"], value["coulomb_force_N"]),
        "stribeck_velocity_mps": value["stribeck_velocity_mps"],
        "stribeck_tail": value.get("stribeck_tail", 0.0),
    }
    if roughness is not None:
        contact |= {
            "roughness_ratio": roughness.ratio,
            "roughness_length_m": roughness.length_m,
            "roughness_seed": roughness.seed,
        }
    table: dict[str, Any] = {"contact": contact, "slide": {"mass_kg": value["mass_kg"]}, "effects": effects}
    if rig.drive == "spring":
        table["drive"] = {
            "stiffness_N_per_m": value["drive_stiffness_N_per_m"],
            "damping_Ns_per_m": value["drive_damping_Ns_per_m"],
        }
    # the exciter of the evidence does as commanded, at once; an exciter that does not is a gap
    table["piezo"] = {"amplitude_max_m": 1.0, "amplitude_slew_m_per_s": 0.0}
    return RigConfig.model_validate(table)


def predict(
    config: RigConfig, force_driven: bool, commands: Commands, start: Start, entries: Sequence[Entry] = ()
) -> dict[str, Floats]:
    """Signals by name, [blocks] each, free of noise. With a force drive the motion says where the slide is, and no entry."""
    (found,) = predict_many([config], force_driven, commands, [start], [entries])
    assert found is not None, "what is wanted is predicted"  # noqa: S101
    return found


def predict_many(
    configs: Sequence[RigConfig],
    force_driven: bool,
    commands: Commands,
    starts: Sequence[Start],
    entries: Sequence[Sequence[Entry]],
    wanted: int | None = None,
) -> list[dict[str, Floats] | None]:
    """As `predict` for each of many rigs in the same run; their entries are in the same blocks.

    With `wanted` the first so many are predicted, and of the others those that fill lanes left empty; the rest is None.
    """
    rigs = [built(config, force_driven, commands, start) for config, start in zip(configs, starts, strict=True)]
    if force_driven:
        return [dict(zip(SIGNALS, _led(rig, commands), strict=True)) for rig in rigs]
    same_steps: dict[bytes, list[int]] = {}
    for number, rig in enumerate(rigs):
        same_steps.setdefault(rig.steps.tobytes(), []).append(number)
    found: dict[int, Floats] = {}
    for numbers in same_steps.values():
        needed = len(numbers) if wanted is None else sum(number < wanted for number in numbers)
        for group in (numbers[first : first + LANES] for first in range(0, needed, LANES)):
            lanes = [*group, *[group[-1]] * (LANES - len(group))]
            signals = _side_by_side([rigs[number] for number in lanes], commands, [entries[one] for one in lanes])
            found |= zip(group, signals, strict=False)
    return [dict(zip(SIGNALS, found[number], strict=True)) if number in found else None for number in range(len(rigs))]


def built(config: RigConfig, force_driven: bool, commands: Commands, start: Start) -> Rig:
    """A rig as the kernels want it, where a run begins."""
    params, state = build(config)
    p: Any = params[0]
    p.force_keep = p.accel_keep = p.position_keep = 0.0
    p.accel_highpass_keep = 1.0
    p.frequency_min_Hz, p.frequency_max_Hz = 1.0, 1e9
    p.force_driven = force_driven
    p.disturbed = p.disturbed or force_driven
    _set_start(p, state[0], start, force_driven)
    contact_rad_per_s = math.sqrt(p.k_t / p.m)
    coarsest_s = min(_LED_STEP_S if force_driven else _COARSEST_STEP_S, _CONTACT_STEP / contact_rad_per_s)
    if p.base_m_per_N > 0.0:  # the bristle between slide and base: stable up to twice this
        base_kg = 1.0 / (p.base_m_per_N * (2.0 * math.pi * p.base_Hz) ** 2)
        coarsest_s = min(coarsest_s, math.sqrt(base_kg / p.k_t))
    steps = np.maximum(
        math.ceil(BLOCK_S / coarsest_s - 1e-9),
        np.ceil(_STEPS_PER_PERIOD * commands.frequency_Hz * BLOCK_S - 1e-9),
    ).astype(np.int64)
    return Rig(params, state, steps)


def _led(rig: Rig, commands: Commands) -> Floats:
    """A rig with a force drive along the measured motion, [signals, blocks]."""
    assert commands.motion is not None, "a force drive without a motion is refused when it is read"  # noqa: S101
    params, state, steps = rig
    p: Any = params[0]
    out = np.empty((len(SIGNALS), len(commands.drive)))
    scratch = int(steps.max())
    analogue, truth = np.empty((len(CHANNELS), scratch)), np.empty((len(TRUTH), scratch))
    stiffness = p.m * _HOLDING_RAD_PER_S**2
    damping = 2.0 * p.m * _HOLDING_RAD_PER_S
    _follow(
        params, state, commands.drive, commands.frequency_Hz, commands.amplitude_m, steps,
        analogue, truth, out, commands.motion.position_m, stiffness, damping,
    )  # fmt: skip
    return out


def _side_by_side(rigs: Sequence[Rig], commands: Commands, entries: Sequence[Sequence[Entry]]) -> Floats:
    """`LANES` rigs with the same steps through a run, [LANES, signals, blocks]."""
    blocks = np.array([entry.block for entry in entries[0]], np.int64)
    ages_s = [[math.nan if entry.age_s is None else entry.age_s for entry in own] for own in entries]
    forces_N = [[entry.force_N for entry in own] for own in entries]
    out = np.empty((LANES, len(SIGNALS), len(commands.drive)))
    advance_lanes(
        np.concatenate([rig.params for rig in rigs]), np.concatenate([rig.state for rig in rigs]),
        commands.drive, commands.frequency_Hz, commands.amplitude_m, rigs[0].steps,
        blocks, np.array(forces_N).T.copy(), np.array(ages_s).T.copy(), out,
    )  # fmt: skip
    return out


def _set_start(p: Any, s: Any, start: Start, force_driven: bool) -> None:
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


@kernel
def _predict(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    drive: Floats,
    frequency_Hz: Floats,
    amplitude_m: Floats,
    steps: npt.NDArray[np.int64],
    analogue: Floats,
    truth: Floats,
    out: Floats,
) -> None:
    p: Record = params[0]
    for block in range(drive.shape[0]):
        samples = steps[block]
        p.samples_per_block = samples
        p.steps_per_sample = 1
        p.dt_s = BLOCK_S / samples
        advance_disturbed(params, state, drive[block], frequency_Hz[block], amplitude_m[block],
                          analogue[:, :samples], truth[:, :samples])  # fmt: skip
        for row in range(5):
            total = 0.0
            for i in range(samples):
                total += analogue[row, i]
            out[row, block] = total / samples
        for row in range(1, 3):
            total = 0.0
            for i in range(samples):
                about = analogue[row, i] - out[row, block]
                total += about * about
            out[4 + row, block] = math.sqrt(total / samples)


@kernel
def _follow(
    params: npt.NDArray[Any],
    state: npt.NDArray[Any],
    force_N: Floats,
    frequency_Hz: Floats,
    amplitude_m: Floats,
    steps: npt.NDArray[np.int64],
    analogue: Floats,
    truth: Floats,
    out: Floats,
    position_m: Floats,
    stiffness: float,
    damping: float,
) -> None:
    """As `_predict`, along a measured motion: the force of `out` is the one that keeps the model on it."""
    s: Record = state[0]
    own = np.empty((out.shape[0], 1))
    force = np.empty(1)
    ahead_before_m = position_m[0] - s.x
    rate_mps = 0.0
    share = 1.0 - math.exp(-BLOCK_S / _RATE_FILTER_S)
    for block in range(force_N.shape[0]):
        ahead_m = position_m[block] - s.x
        rate_mps += share * ((ahead_m - ahead_before_m) / BLOCK_S - rate_mps)
        ahead_before_m = ahead_m
        force[0] = force_N[block] + stiffness * ahead_m + damping * rate_mps
        _predict(params, state, force, frequency_Hz[block : block + 1], amplitude_m[block : block + 1],
                 steps[block : block + 1], analogue, truth, own)  # fmt: skip
        for row in range(out.shape[0]):
            out[row, block] = own[row, 0]
