"""The linear evidence on rigs that the plant makes."""

import pytest

from bench.judge.linear.answer import answer
from bench.judge.linear.judge import NONE, OUTSIDE
from tests.made_evidence import made_evidence
from tests.made_protocols import case_of

pytestmark = pytest.mark.slow


@pytest.mark.parametrize(
    ("name", "effects"),
    [
        (NONE, {}),
        ("force-sensor-gain", {"force-sensor-gain": {"form": "", "ratio": 0.08}}),
        ("drive-damping", {"drive-damping": {"form": "viscous", "damping_Ns_per_m": 20.0}}),
    ],
)
def test_the_effect_of_a_made_rig_is_named(name: str, effects: dict[str, dict[str, float | str]]) -> None:
    """The truth has the largest probability, and the library explains the rig."""
    given = answer(made_evidence(case_of("short", effects), 1), None)
    assert max((value, key) for key, value in given.items() if key != OUTSIDE)[1] == name
    assert given[name] > 0.8
    assert given[OUTSIDE] < 0.5
