"""Waves and smooth noise used by several effects."""

import math

from bridge.kernel import kernel

TWO_PI = 2.0 * math.pi


@kernel
def lattice_value(index: float, seed: float) -> float:
    """A pseudo-random number of variance 1 for a lattice point: the same on every computer, without a generator."""
    mixed = math.sin(index * 12.9898 + seed * 78.233) * 43758.5453
    return (mixed - math.floor(mixed) - 0.5) * math.sqrt(12.0)


@kernel
def smooth_noise(at: float, seed: float) -> float:
    """Noise with mean 0 and variance 1, smooth, with a new value at every whole number."""
    index = math.floor(at)
    return noise_in_cell(at - index, lattice_value(index, seed), lattice_value(index + 1.0, seed))


@kernel
def noise_in_cell(share: float, before: float, after: float) -> float:
    """Smooth noise between two lattice points, from its values there and the share of the distance."""
    share = share * share * (3.0 - 2.0 * share)
    # scaled to variance 1: the mean of (1 - share)^2 + share^2 over a cell is 26/35
    return (before * (1.0 - share) + after * share) / math.sqrt(26.0 / 35.0)


@kernel
def wave(angle_rad: float, second_sin: float, second_cos: float) -> float:
    """A sine with its second harmonic."""
    return with_second(math.sin(angle_rad), math.cos(angle_rad), second_sin, second_cos)


@kernel
def with_second(sin: float, cos: float, second_sin: float, second_cos: float) -> float:
    """A sine with its second harmonic, from the sine and the cosine of its angle."""
    return sin + second_sin * 2.0 * sin * cos + second_cos * (1.0 - 2.0 * sin * sin)
