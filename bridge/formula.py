"""Formulas of a fixed grammar, over numbers and named values; no text is executed as Python.

    sum      = product (("+" | "-") product)*
    product  = factor (("*" | "/") factor)*
    factor   = ("+" | "-")* (number | name | "(" sum ")")

A number is as in TOML without underscores, such as 2, 0.5 or 1.2e7; a name has letters, digits and underscores.
"""

import math
import operator
import re
from collections.abc import Callable, Mapping

import numpy as np

from bridge.arrays import Floats

_TOKEN = re.compile(r"(\d+\.?\d*(?:[eE][+-]?\d+)?|\.\d+(?:[eE][+-]?\d+)?)|([^\W\d]\w*)|([-+*/()])")
_OPERATORS: dict[str, Callable[[Floats, Floats], Floats]] = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
_LONGEST = 500  # characters: it is computed for each block
_DEEPEST = 50  # brackets and signs in each other: beyond, Python's own stack ends


class _Parser:
    """Turns a text into steps: values, and operators that act on the two newest ones."""

    def __init__(self, text: str) -> None:
        self.text, self.steps = text, list[float | str | tuple[str]]()
        self._tokens: list[tuple[int, str, str]] = []  # place, kind (number, name or itself), text
        at = 0
        while at < len(text):
            if text[at].isspace():
                at += 1
                continue
            match = _TOKEN.match(text, at)
            if match is None:
                raise self._error(at, f"{text[at]!r} must not be there; use + - * / ( ), numbers and names")
            number, name, _ = match.groups()
            self._tokens.append((at, "number" if number else "name" if name else match[0], match[0]))
            at = match.end()
        self._tokens.append((len(text), "end", "its end"))
        if len(text) > _LONGEST:
            raise self._error(_LONGEST, f"a formula has at most {_LONGEST} characters; shorten it")
        self._next = self._depth = 0
        self.sum()
        if self._kind != "end":
            raise self._expected("an operator")

    @property
    def _kind(self) -> str:
        return self._tokens[self._next][1]

    def _error(self, at: int, rule: str) -> ValueError:
        return ValueError(f"character {at + 1} of {self.text[:_LONGEST]!r}: {rule}")

    def _expected(self, what: str) -> ValueError:
        at, _, text = self._tokens[self._next]
        return self._error(at, f"must be {what}, not {text}")

    def _take(self) -> str:
        self._next += 1
        return self._tokens[self._next - 1][2]

    def sum(self) -> None:
        self._chain("+-", lambda: self._chain("*/", self._factor))

    def _chain(self, operators: str, part: Callable[[], None]) -> None:
        part()
        while self._kind in tuple(operators):
            symbol = self._take()
            part()
            self.steps.append((symbol,))

    def _factor(self) -> None:
        self._depth += 1
        if self._depth > _DEEPEST:
            raise self._error(self._tokens[self._next][0], f"at most {_DEEPEST} brackets in each other; shorten it")
        kind = self._kind
        if kind in ("+", "-"):
            symbol = self._take()
            self.steps.append(0.0)
            self._factor()
            self.steps.append((symbol,))
        elif kind == "number":
            if not math.isfinite(float(self._tokens[self._next][2])):
                raise self._expected("a number below 1.8e308")
            self.steps.append(float(self._take()))
        elif kind == "name":
            self.steps.append(self._take())
        elif kind == "(":
            self._take()
            self.sum()
            if self._kind != ")":
                raise self._expected("an operator or )")
            self._take()
        else:
            raise self._expected("a number, a name or (")
        self._depth -= 1


class Formula:
    """A formula.

    Args:
        text: as in the grammar above. Raises ValueError with place and rule.

    """

    def __init__(self, text: str) -> None:
        self.text = text
        self._steps = _Parser(text).steps
        self.names = frozenset(step for step in self._steps if isinstance(step, str))

    @staticmethod
    def is_name(text: str) -> bool:
        """Whether a text may be a name in a formula."""
        match = _TOKEN.fullmatch(text)
        return match is not None and match[2] is not None

    def __call__(self, values: Mapping[str, Floats | float]) -> Floats:
        """The value, for arrays element by element; NaN or infinite where a division by zero makes it so.

        Raises KeyError for a name without a value.
        """
        stack: list[Floats] = []
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            for step in self._steps:
                if isinstance(step, tuple):
                    right = stack.pop()
                    stack.append(_OPERATORS[step[0]](stack.pop(), right))
                else:
                    stack.append(np.asarray(values[step] if isinstance(step, str) else step, np.float64))
        return stack[0]
