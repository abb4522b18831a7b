"""The language gets plainer and the tree no larger: counts of `tests/ratchet.py` stay at or below their limits."""

import pytest

from tests import ratchet

pytestmark = pytest.mark.slow  # parses every file


@pytest.fixture(scope="module")
def now() -> dict[str, dict[str, float]]:
    return ratchet.counts()


@pytest.mark.parametrize("table", ratchet.limits())
def test_no_count_rises(now: dict[str, dict[str, float]], table: str) -> None:
    limits = ratchet.limits()[table]
    raised = {name: (count, limits.get(name, 0)) for name, count in now[table].items() if count > limits.get(name, 0)}
    assert not raised, "tests/unit/ratchet.toml holds the limits"


def test_the_dialect_is_seen() -> None:
    source = '"""It tells what it is told."""\none = "nobody of its own says so"  # stands\nplain = "force above the limit"\n'
    prose, messages, names = ratchet._of_python(source)
    assert (ratchet._rate(prose), names) == (1000 * 4 / 8, 1)
    assert messages == ["nobody of its own says so", "force above the limit"]
