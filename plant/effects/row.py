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
    """One form of an effect: its formula as text, and its parameters."""

    formula: str
    parameters: tuple[Parameter, ...]  # the first is the size of the effect


class Effect(NamedTuple):
    """An effect: its forms, and its numbers in the plant's records."""

    acts_on: Literal["friction", "drive", "structure", "piezo", "sensor"]
    forms: dict[str, Formula]
    # writes the effect into the record PARAMS after `prefix` and `scales`; arguments: record, form, its parameters by name
    set_numbers: Callable[[Any, str, dict[str, float]], None] | None = None
    prefix: str | None = None  # before a parameter's name: its field of PARAMS; None: no such fields
    scales: str = ""  # field of PARAMS that grows by the parameter `ratio`
    numbers: tuple[str, ...] = ()  # fields of PARAMS for this effect that `set_numbers` writes
    switches: tuple[str, ...] = ()  # fields besides `sizes` that need the separate kernel unless they are 0
    off: dict[str, float] = {}  # values of the fields while the effect is off, if not 0
    memory: tuple[tuple[Any, ...], ...] = ()  # state of the effect: fields of STATE, as numpy describes them
    drives: tuple[str, ...] = ("spring", "force")  # kinds of drive of the rigs that can have the effect
    first: bool = False  # applied before the others, which are relative to its result, whatever their order in a file

    @property
    def fields(self) -> dict[str, str]:
        """Field of PARAMS by parameter, for all forms."""
        names = [parameter.name for form in self.forms.values() for parameter in form.parameters]
        return {} if self.prefix is None else {name: self.prefix + name for name in names}

    @property
    def sizes(self) -> list[str]:
        """Fields of the first parameter of each form; while they are 0 the effect does not act."""
        return [self.fields[form.parameters[0].name] for form in self.forms.values() if self.fields]

    def apply(self, p: Any, form: str, value: dict[str, float]) -> None:
        """Write the effect with the parameters of a form into a record PARAMS; parameters of other forms are off."""
        for name, number in value.items():
            if name in self.fields:
                p[self.fields[name]] = number
        if self.scales:
            p[self.scales] *= 1.0 + value["ratio"]
        if self.set_numbers is not None:
            self.set_numbers(p, form, value)


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
