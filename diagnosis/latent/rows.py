"""Rows of the latent friction: how far the friction is from the described one, and under which conditions."""

from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.arrays import Floats
from diagnosis.gap.prepare import Prepared

BREAKAWAY, SLIDING = "breakaway level", "sliding friction"
# Rows of one signal that are kept, evenly spread; the work grows with them: 5000 with four causes take 3 s of CPU, 10 000 6 s. At
# 240 the waves of a gear are shorter than a row.
MOST_ROWS = 5000
STANDS = 0.02  # share of its fastest velocity below which a slide or a drive turns


class ExcessRows(NamedTuple):
    """Excess levels of one signal. Arrays are [rows], in time order within a run."""

    signal: str  # BREAKAWAY or SLIDING
    excess_N: Floats  # of the friction, positive against the motion, over the described friction
    sign: Floats  # of the motion, 1 or -1
    place_m: Floats
    t_s: Floats  # since the first run began
    speed_mps: Floats  # of the slide; of the drive for breakaways; 0 or more
    run: npt.NDArray[np.int64]
    held_out: npt.NDArray[np.bool_]
    load_N: Floats | None  # normal load
    pull_N: Floats | None  # inertia, positive along the motion; of an axis
    rate_N_per_s: Floats | None  # of the force, positive along the motion; of an axis
    noise_N: float  # standard deviation that the sensors add to a row

    def some(self, mask: npt.NDArray[Any]) -> "ExcessRows":
        """The rows `mask`: indices or marks."""
        return self._replace(
            **{
                name: values[mask]
                for name, values in self._asdict().items()
                if isinstance(values, np.ndarray) and values.ndim == 1
            }
        )

    def thinned(self) -> "ExcessRows":
        """At most `MOST_ROWS` rows, evenly spread."""
        count = len(self.excess_N)
        if count <= MOST_ROWS:
            return self
        return self.some(np.unique(np.linspace(0, count - 1, MOST_ROWS).round().astype(np.int64)))


def together(parts: list[ExcessRows]) -> ExcessRows | None:
    """The rows of several runs as one; None without any."""
    if not parts:
        return None
    first = parts[0]

    def joined(name: str) -> Any:
        values = [getattr(part, name) for part in parts]
        return None if any(value is None for value in values) else np.concatenate(values)

    arrays = ("excess_N", "sign", "place_m", "t_s", "speed_mps", "run", "held_out", "load_N", "pull_N", "rate_N_per_s")
    noise_N = float(np.mean([part.noise_N for part in parts]))
    return ExcessRows(first.signal, **{name: joined(name) for name in arrays}, noise_N=noise_N)


def noise_of_force_N(run: Prepared) -> float:
    """Standard deviation of the force sensor's noise in a block."""
    return float(np.std(run.noise.pieces["drive_force_N"]))
