"""Zero of the force sensor, from a stretch at the beginning without motion."""

import numpy as np

from bridge.arrays import Floats
from bridge.log.finding import Finding
from bridge.log.watches.arrays import noise_of

_FIRST = 20  # samples for the first estimate of the level
_FEWEST = 50  # fewest samples of a stretch
# Length of the stretch, as a share of the record: a shorter stretch belongs to a rise, a longer stretch is a record at rest.
_LEAST_SHARE, _MOST_SHARE = 0.005, 0.5
_STILL = 0.01  # share of the range of the force; a smaller change is not a rise
_OF_NOISE = 6.0  # standard deviations: no sample of pure noise in a stretch exceeds them
_LARGEST = 0.25  # largest zero as a share of the force afterwards; a larger force is a load on a slide at rest


def tare_of(force_N: Floats, position_m: Floats | None, where: str) -> tuple[float, list[Finding]]:
    """The zero of a force sensor, and a finding; 0 without a stretch of rest at the beginning.

    Args:
        force_N: [samples]; NaN: missing.
        position_m: position of the drive, [samples], if known.
        where: file and channel, for the finding.

    """
    known = np.flatnonzero(np.isfinite(force_N))
    values = force_N[known]
    if len(values) < 4 * _FEWEST:
        return 0.0, []
    reach = float(np.subtract(*np.quantile(values, (0.99, 0.01))))
    level = float(np.median(values[:_FIRST]))
    allowed = max(_STILL * reach, _OF_NOISE * noise_of(values[:_FEWEST]))
    leaves = np.flatnonzero(np.abs(values - level) > allowed)
    if not len(leaves) or not max(_FEWEST, _LEAST_SHARE * len(values)) < leaves[0] < _MOST_SHARE * len(values):
        return 0.0, []
    # the last tenth may belong to the rise
    still = slice(0, int(0.9 * leaves[0]))
    halves = values[still][: len(values[still]) // 2 * 2].reshape(2, -1).mean(axis=1)
    allowed = _OF_NOISE * noise_of(values[still]) / np.sqrt(leaves[0] / 2.0) + 1e-3 * reach
    if abs(float(halves[1] - halves[0])) > allowed:  # the force rises slowly
        return 0.0, []
    if position_m is not None and not _is_still(position_m[known], still):
        return 0.0, []
    zero_N = float(values[still].mean())
    text = f"{zero_N:.4g} in the first {leaves[0]} rows, in which the force is constant"
    if abs(zero_N) > _LARGEST * float(np.median(np.abs(values[leaves[0] :]))):
        return 0.0, [Finding("tare", where, f"{text}: too large for a sensor's zero, so it is not subtracted")]
    if zero_N == 0.0:
        return 0.0, []
    return zero_N, [
        Finding("tare", where, f"{text}, is taken as the sensor's zero and subtracted; with a map it is kept")
    ]


def _is_still(position_m: Floats, still: slice) -> bool:
    range_m = float(np.nanmax(position_m) - np.nanmin(position_m))
    part_m = position_m[still]
    return bool(np.nanmax(part_m) - np.nanmin(part_m) < _STILL * range_m)
