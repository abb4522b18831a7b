"""The force as a function of the extension e of the spring: a massless linear spring, measured without delay, pulls with k e."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from diagnosis.features.grid import BLOCK_S
from diagnosis.features.moving_mean import moving_mean
from diagnosis.features.segments import Segment

_ENTRY_MARGIN = 10  # blocks left out around the start of a segment: longer than the delays of a measuring chain
# Widths of two moving means, in slip durations; the bend is fitted to the band between them. Shorter short mean: noise of the
# displacement sensors, which grows with the square of frequency; longer: it smears the slip. Longer long mean: a sensor's bow
# looks like a bend; shorter: the slip is removed. Counted on 60 rigs without a gap (docs/method/diagnosis.md).
_SHORT, _LONG = 0.25, 8.0


def spring_law(
    force_N: Floats, extension_m: Floats, segments: Sequence[Segment], scale_N: float, stiffness_N_per_m: float
) -> dict[str, float]:
    """Part of the force [N] that follows the extension, its rate, its cube, time and direction; and the rest's mean square.

    The parts are fitted one after the other: stiffness, rate, cube, time, direction (NaN in a run of one direction), rest.

    Args:
        force_N, extension_m: [blocks] each.
        segments: segments of the run.
        scale_N, stiffness_N_per_m: typical force and stiffness, which scale the columns.

    """
    even = _away_from_entries(segments, len(force_N), _ENTRY_MARGIN)
    rate_mps = np.gradient(moving_mean(extension_m, 5), BLOCK_S)[even]
    force_N, extension_m = force_N[even], extension_m[even]
    extension_m = extension_m - extension_m.mean() + force_N.mean() / stiffness_N_per_m
    reaches = extension_m * (stiffness_N_per_m / scale_N)
    both = force_N.min() < -0.3 * scale_N and force_N.max() > 0.3 * scale_N
    columns = {
        "stiffness": reaches,
        "rate": rate_mps * 1e3,
        "cube": reaches * reaches * reaches,  # `**` would take as long as the rest of this function
        "time": np.linspace(-1.0, 1.0, len(even))[even],
    }
    if both:
        columns["direction"] = np.sign(force_N)
    law, rest = _sequential_fit(columns, force_N)
    law.setdefault("direction", math.nan)
    return law | {"rest": max(rest, 0.0) / len(force_N)}


def spring_bend(force_N: Floats, extension_m: Floats, segments: Sequence[Segment], slip_s: float) -> float:
    """The force [N] for each m/s2 of the extension's second derivative, in the band of the slips.

    A force with a delay of T is F - T F' + T^2 F'' / 2. Behind n equal low-passes with the same total delay, the factor of T^2
    F'' is (n + 1) / (2 n) instead of 1/2. A swinging frame bends the force without a delay. So the bend separates a delay, a
    low-pass and a frame.
    """
    short, long = (max(round(slips * slip_s / BLOCK_S), 1) for slips in (_SHORT, _LONG))
    level_m = moving_mean(extension_m, short)
    padded_m = np.pad(level_m, short, mode="edge")
    earlier_m, later_m = padded_m[: -2 * short], padded_m[2 * short :]
    columns = {
        "stiffness": level_m,
        "rate": (later_m - earlier_m) / (2 * short * BLOCK_S),
        "bend": (later_m - 2.0 * level_m + earlier_m) / (short * BLOCK_S) ** 2,
    }
    even = _away_from_entries(segments, len(force_N), _ENTRY_MARGIN + 2 * short)
    fast = {name: (values - moving_mean(values, long))[even] for name, values in columns.items()}
    level_N = moving_mean(force_N, short)
    law, _ = _sequential_fit(fast, (level_N - moving_mean(level_N, long))[even])
    return law["bend"]


def _away_from_entries(segments: Sequence[Segment], blocks: int, about: int) -> npt.NDArray[np.bool_]:
    """Marks [blocks] without `about` blocks around the start of each segment, where the model starts at the measured force."""
    even = np.ones(blocks, np.bool_)
    for segment in segments:
        if segment.still or segment.slips > 0:
            even[max(segment.first - about, 0) : segment.first + about] = False
    return even


def _sequential_fit(columns: Mapping[str, Floats], force_N: Floats) -> tuple[dict[str, float], float]:
    """Coefficient of the force [blocks] on each column, orthogonal to the columns before it; and the rest's sum of squares.

    A fit of all columns at once would transfer the noise of a column to the others.
    """
    centred = np.array([*columns.values(), force_N])
    centred -= centred.mean(axis=1, keepdims=True)
    products = centred @ centred.T
    shares: dict[str, float] = {}
    for i, name in enumerate(columns):
        freed = products[i] / (products[i, i] + 1e-30)
        shares[name] = float(freed[-1])
        products -= np.outer(products[i], freed)
    return shares, float(products[-1, -1])
