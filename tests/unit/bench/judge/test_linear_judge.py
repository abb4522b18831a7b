"""The judge of the linear evidence, on ledgers made by hand."""

from bench.judge.linear.judge import NONE, OUTSIDE, judge
from bench.judge.linear.witnessed import Ledger, Row
from diagnosis.model.rig import Roughness

N, KEPT = 600, 300  # compared features
SURFACE = Roughness(0.003, 1e-4, 0)


def row(name: str, left: float, kept: float, freedom: float = -12.0, relations: float = 0.0) -> Row:
    """An explanation with this remainder of each feature."""
    return Row(frozenset(filter(None, name.split(" + "))), left * N, kept * KEPT, freedom, relations)


def ledger(*rows: Row, beyond: float = 0.0) -> Ledger:
    """Rows of one evidence."""
    return Ledger(rows, N, KEPT, beyond, False, SURFACE)


NOTHING = row("", 5.0, 6.0, -8.0)


def test_an_effect_that_leaves_noise_alone_is_named() -> None:
    """An effect that closes the gap on the kept runs too has the probability, and outside has little."""
    given = judge(ledger(NOTHING, row("drive-damping", 0.25, 0.3), row("frame-compliance", 3.0, 4.0)))
    assert given["drive-damping"] > 0.99
    assert given[OUTSIDE] < 0.1


def test_a_gain_that_chance_makes_is_no_name() -> None:
    """Of a rig without a gap, the best of many effects always leaves a little less."""
    given = judge(ledger(row("", 0.33, 0.6, -8.0), row("friction-drift", 0.32, 0.6), row("coulomb-level", 0.3, 0.62)))
    assert given[NONE] > 0.9
    assert given[OUTSIDE] < 0.5


def test_a_small_part_of_a_large_remainder_is_no_name() -> None:
    """Where formulas of friction differ from the rig, the same ratio counts less than near the noise."""
    far = judge(ledger(row("", 16.0, 13.0, -8.0), row("force-sensor-gain", 11.0, 10.0)))
    near = judge(ledger(row("", 0.8, 0.65, -8.0), row("force-sensor-gain", 0.55, 0.5)))
    assert far["force-sensor-gain"] < 0.5 < near["force-sensor-gain"]


def test_a_relation_decides_between_effects_that_fit_alike() -> None:
    """Evidence of a relation adds to the evidence of the fits."""
    given = judge(ledger(NOTHING, row("force-sensor-lag", 0.4, 0.4, relations=50.0), row("drive-damping", 0.39, 0.4)))
    assert given["force-sensor-lag"] > 0.99


def test_a_name_that_costs_freedom_is_less_likely() -> None:
    """Of two with the same remainder, the name has fewer free numbers."""
    given = judge(
        ledger(NOTHING, row("static-level", 0.4, 0.4, -9.0), row("position-dependent-friction", 0.4, 0.4, -20.0))
    )
    assert given["static-level"] > 0.99


def test_a_pattern_of_a_relation_that_the_library_lacks_is_outside() -> None:
    """The second question does not compete with the names."""
    given = judge(ledger(NOTHING, row("drive-damping", 2.0, 3.0), beyond=0.7))
    assert given[OUTSIDE] > 0.5
    assert abs(sum(value for name, value in given.items() if name != OUTSIDE) - 1.0) < 1e-9
