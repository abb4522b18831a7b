"""A row of the library: an effect with its forms, their parameters, and its numbers in the plant's records."""

import math
from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple


class Parameter(NamedTuple):
    """A number of a form; `low` and `high` are the limits in a rig file, both included."""

    name: str  # carries its unit; `ratio` is relative to the nominal value
    low: float
    high: float
    default: float


class Formula(NamedTuple):
    """One formula of an effect."""

    formula: str
    parameters: tuple[Parameter, ...]


class Effect(NamedTuple):
    """A row of the library."""

    acts_on: Literal["friction", "drive", "structure", "piezo", "sensor"]
    forms: dict[str, Formula]
    # writes the effect into the record PARAMS; arguments: record, form, parameters of the form by name
    set_numbers: Callable[[Any, str, dict[str, float]], None]
    numbers: tuple[str, ...] = ()  # fields of PARAMS for this effect; empty if it only changes numbers of the rig
    switches: tuple[str, ...] = ()  # while these fields are all 0, the effect needs no separate kernel
    off: dict[str, float] = {}  # values of the fields while the effect is off, if not 0
    memory: tuple[tuple[Any, ...], ...] = ()  # state of the effect: fields of STATE, as numpy describes them
    drives: tuple[str, ...] = ("spring", "force")  # kinds of drive that can have it
    first: bool = False  # applied before the others, which are relative to its result, whatever their order in a file


TURN_RAD: Final = 2.0 * math.pi
# a wave is w(a) = sin a + second_sin sin 2a + second_cos cos 2a, a including the phase: few real waves are pure sines
WAVE_SHAPE: Final = (
    Parameter("phase_rad", -TURN_RAD, TURN_RAD, 0.0),
    Parameter("second_sin", -1.0, 1.0, 0.0),
    Parameter("second_cos", -1.0, 1.0, 0.0),
)


def ratio(default: float, low: float = -0.9, high: float = 10.0) -> Parameter:
    """The size of an effect, relative to the nominal value."""
    return Parameter("ratio", low, high, default)


def one_form(formula: str, *parameters: Parameter) -> dict[str, Formula]:
    """The unnamed single form of an effect."""
    return {"": Formula(formula, parameters)}


def wave_shape(value: dict[str, float]) -> tuple[float, float, float]:
    """Phase and second harmonic of a wave; 0 for a form without them."""
    phase_rad, second_sin, second_cos = (value.get(parameter.name, 0.0) for parameter in WAVE_SHAPE)
    return phase_rad, second_sin, second_cos
