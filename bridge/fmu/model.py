"""The content of an FMU: the records of a kernel, which are its memory, and the variables in them."""

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from bridge.units import unit_of

TYPES = {"f8": "Float64", "f4": "Float32", "i8": "Int64", "u8": "UInt64", "u4": "UInt32"}  # of FMI 3, by NumPy's
_ALIGNED = 16  # bytes; the memory begins with the time


class Variable(NamedTuple):
    """A number or an array in the memory."""

    name: str
    causality: str  # input, output or parameter
    at: int  # place in the memory, in bytes
    type: str  # a value of TYPES
    length: int = 1
    start: str | None = None  # of an input or a parameter
    unit: str = ""
    is_mean: bool = False  # an output without arrays: the mean of `length` values


_TIME = Variable("time", "independent", 0, "Float64", unit="s")


class Model(NamedTuple):
    """A compiled kernel with its records."""

    name: str
    about: str
    module: str  # its function `compiled(variant, samples)` gives the types of the records, and the kernel
    variant: str
    samples: int
    step_s: float
    most_steps: int  # that the master may ask for at once
    parts: list[Any]  # one record each, in the order of the kernel's arguments
    variables: list[Variable]

    @property
    def memory(self) -> bytes:
        """The memory at the start."""
        return bytes(_ALIGNED) + b"".join(part.tobytes().ljust(_room(part), b"\0") for part in self.parts)

    @property
    def rows(self) -> list[Variable]:
        """All variables; the place of each is its reference."""
        return [_TIME, *self.variables]

    def places(self) -> list[int]:
        """Place of each record in the memory, in bytes."""
        return [_ALIGNED + sum(map(_room, self.parts[:number])) for number in range(len(self.parts))]

    def without_arrays(self) -> "Model":
        """The model for FMI 2: an output has its last value, and its mean as `NAME_mean`."""
        variables: list[Variable] = []
        for v in self.variables:
            last = v._replace(at=v.at + 8 * (v.length - 1), length=1)
            variables += [last] if v.length == 1 else [last, v._replace(name=f"{v.name}_mean", is_mean=True)]
        return self._replace(variables=variables)


def variables_of(part: Any, at: int, causality: str, names: Mapping[str, str]) -> Iterator[Variable]:
    """The variables of fields of a record: their names by the names of the fields; the record holds their start values.

    Args:
        part: the record.
        at: its place in the memory.
        causality: as in `Variable`.
        names: name of the variable by field.

    """
    for field, name in names.items():
        kind, offset = part.dtype.fields[field][:2]
        base, shape = kind.subdtype or (kind, ())
        first = part[field].reshape(-1)[0].item()
        start = None if causality == "output" else repr(first) if base.kind == "f" else str(first)
        unit = unit_of(name.rpartition(".")[2]) if base.kind == "f" else "1"  # FMI has no units of integers
        yield Variable(
            name, causality, at + offset, TYPES[base.str[1:]], int(np.prod(shape)), start, unit if unit != "1" else "",
        )  # fmt: skip


def _room(part: Any) -> int:
    return -(-part.nbytes // _ALIGNED) * _ALIGNED
