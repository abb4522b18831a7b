"""Formulas: their values, and one line with place and rule for each other text."""

import numpy as np
import pytest

from bridge.formula import Formula

VALUES = {"k_d": 2.0, "a": np.array([1.0, 4.0, np.nan]), "b": 3.0}


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("k_d * (a - b)", [-4.0, 2.0, np.nan]),
        ("a - b - k_d", [-4.0, -1.0, np.nan]),
        ("b / k_d / .5", 3.0),
        ("-2 + 3*-4/(1 - 5e-1)", -26.0),
        ("2 -- +3", 5.0),
        ("1.5e+3", 1500.0),
        ("b / 0", np.inf),
    ],
)
def test_the_value_of_a_formula(text: str, value: object) -> None:
    np.testing.assert_array_equal(Formula(text)(VALUES), value)


def test_the_names_of_a_formula() -> None:
    assert Formula("k_d * (a - 2e3 * a)").names == {"k_d", "a"}
    assert [Formula.is_name(text) for text in ("k_d", "k2", "2k", "a b", "-", "")] == [
        True,
        True,
        False,
        False,
        False,
        False,
    ]
    with pytest.raises(KeyError):
        Formula("c")(VALUES)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("a b", "character 3 of 'a b': must be an operator, not b"),
        ("(a", r"character 3 of '\(a': must be an operator or \), not its end"),
        ("a +", r"character 4 of 'a \+': must be a number, a name or \(, not its end"),
        ("a ** b", "character 4 of .*not \\*"),
        ("", "character 1 of '': must be a number, a name"),
        ("a.b", "character 2 of 'a.b': '.' must not be there; use"),
        ("__import__('os')", "character 12 of .*must not be there"),
        ("1e999", "must be a number below 1.8e308, not 1e999"),
        ("(" * 60 + "1" + ")" * 60, "at most 50 brackets in each other"),
        ("-" * 60 + "1", "at most 50 brackets in each other"),
        ("1+" * 300 + "1", "character 501 of .*: a formula has at most 500 characters"),
    ],
)
def test_a_text_that_is_none_is_one_line(text: str, line: str) -> None:
    with pytest.raises(ValueError, match=line):
        Formula(text)
