"""The force of a stretch at the beginning in which nothing moves: the zero of the sensor."""

import numpy as np
import numpy.typing as npt

from bridge.log.finding import Finding
from bridge.log.watches.arrays import noise_of

Floats = npt.NDArray[np.float64]
_FIRST = 20  # samples, from which the level is read
_FEWEST = 50  # samples of a stretch that is one
_LEAST_SHARE, _MOST_SHARE = 0.005, 0.5  # of the record: less is the foot of a climb, more a record of rest
_STANDS = 0.01  # of the range of the force: what stays within is no climb
_OF_NOISE = 6.0  # standard deviations, which none of the samples of a stretch of noise reaches
_LARGEST = 0.25  # of the force afterwards: a larger one is that of a slide that stands under load


def tare_of(force_N: Floats, position_m: Floats | None, where: str) -> tuple[float, list[Finding]]:
    """The zero of a force, and a finding that tells it; 0 where no stretch at the beginning shows one.

    Args:
        force_N: [samples]; NaN for none.
        position_m: of the drive, [samples], where it is known.
        where: file and channel, for the finding.

    """
    known = np.flatnonzero(np.isfinite(force_N))
    values = force_N[known]
    if len(values) < 4 * _FEWEST:
        return 0.0, []
    reach = float(np.subtract(*np.quantile(values, (0.99, 0.01))))
    level = float(np.median(values[:_FIRST]))
    allowed = max(_STANDS * reach, _OF_NOISE * noise_of(values[:_FEWEST]))
    leaves = np.flatnonzero(np.abs(values - level) > allowed)
    if not len(leaves) or not max(_FEWEST, _LEAST_SHARE * len(values)) < leaves[0] < _MOST_SHARE * len(values):
        return 0.0, []
    # what comes right before it leaves is the foot of the climb
    still = slice(0, int(0.9 * leaves[0]))
    halves = values[still][: len(values[still]) // 2 * 2].reshape(2, -1).mean(axis=1)
    sure = _OF_NOISE * noise_of(values[still]) / np.sqrt(leaves[0] / 2.0) + 1e-3 * reach
    if abs(float(halves[1] - halves[0])) > sure:  # it climbs slowly
        return 0.0, []
    if position_m is not None and not _stands(position_m[known], still):
        return 0.0, []
    zero_N = float(values[still].mean())
    text = f"{zero_N:.4g} in the first {leaves[0]} rows, in which the force stands"
    if abs(zero_N) > _LARGEST * float(np.median(np.abs(values[leaves[0] :]))):
        return 0.0, [Finding("tare", where, f"{text}: too much for a sensor's zero, so it is left as it is")]
    if zero_N == 0.0:
        return 0.0, []
    return zero_N, [
        Finding("tare", where, f"{text}, is taken for the sensor's zero and subtracted; a map reads it as it is")
    ]


def _stands(position_m: Floats, still: slice) -> bool:
    whole = float(np.nanmax(position_m) - np.nanmin(position_m))
    own = position_m[still]
    return bool(np.nanmax(own) - np.nanmin(own) < _STANDS * whole)
