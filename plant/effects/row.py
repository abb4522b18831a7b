"""What a row of the library holds: an effect with its forms, their parameters, and its numbers in the plant's records."""

import math
from collections.abc import Callable
from typing import Any, Final, Literal, NamedTuple


class Parameter(NamedTuple):
    """A number of a form; `low` and `high` are what a rig file may say, ends included."""

    name: str  # carries its unit; `ratio` is relative to the nominal value
    low: float
    high: float
    default: float


class Form(NamedTuple):
    """One formula of an effect."""

    formula: str
    parameters: tuple[Parameter, ...]


class Effect(NamedTuple):
    """A row of the library."""

    acts_on: Literal["friction", "drive", "structure", "piezo", "sensor"]
    forms: dict[str, Form]
    # writes the effect into the record PARAMS: (record, form, the form's parameters by name)
    set_numbers: Callable[[Any, str, dict[str, float]], None]
    numbers: tuple[
        str, ...
    ] = ()  # the effect's own fields of PARAMS; an effect that changes numbers of the rig alone has none
    switches: tuple[str, ...] = ()  # fields of those: while all are 0 the effect needs no kernel of its own
    off: dict[str, float] = {}  # what fields are while the effect is off, where that is not 0
    memory: tuple[tuple[Any, ...], ...] = ()  # what the effect remembers: fields of STATE, as numpy describes them
    drives: tuple[str, ...] = ("spring", "force")  # kinds of drive that can have it
    first: bool = False  # others are relative to what this one changes, in whatever order a file names them


TURN_RAD: Final = 2.0 * math.pi
# a wave is w(a) = sin a + second_sin sin 2a + second_cos cos 2a, a with the phase: few real ones are pure
WAVE_SHAPE: Final = (
    Parameter("phase_rad", -TURN_RAD, TURN_RAD, 0.0),
    Parameter("second_sin", -1.0, 1.0, 0.0),
    Parameter("second_cos", -1.0, 1.0, 0.0),
)


def ratio(default: float, low: float = -0.9, high: float = 10.0) -> Parameter:
    """The size of an effect, relative to the nominal value."""
    return Parameter("ratio", low, high, default)


def one_form(formula: str, *parameters: Parameter) -> dict[str, Form]:
    """The forms of an effect that has one formula only, which needs no name."""
    return {"": Form(formula, parameters)}


def wave_shape(value: dict[str, float]) -> tuple[float, float, float]:
    """Phase and second harmonic of a wave: 0 in a form that has none."""
    phase_rad, second_sin, second_cos = (value.get(parameter.name, 0.0) for parameter in WAVE_SHAPE)
    return phase_rad, second_sin, second_cos
