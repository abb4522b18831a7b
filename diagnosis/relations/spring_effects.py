"""The columns of the spring relation: what each effect of spring, clamp, frame and force sensor adds to the force."""

import math
from collections.abc import Sequence

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.model.sensor_chain import delayed, low_pass
from diagnosis.relations.relation import Floats, Term, term
from diagnosis.relations.shapes import mode, play

_DAMPING = 0.16  # of a large effect, as a share of the critical damping
_RELAXES_S = (2e-3, 4e-3, 8e-3)
_DELAYS_S = (3e-4, 6e-4, 1e-3, 1.5e-3, 2e-3, 3e-3, 4e-3, 6e-3)
_LAGS_S = (3e-4, 6e-4, 1e-3, 1.6e-3, 2.5e-3, 4e-3, 7e-3)
_KNEES = (0.3, 0.4, 0.5, 0.57, 0.64, 0.71, 0.78, 0.85, 0.92)  # of the largest force
_YIELDS = (0.04, 0.06, 0.09, 0.13, 0.18, 0.25)  # of the extension at the largest force
_EDGES = (0.02, 0.05, 0.1)  # softness of a backlash, of the largest force
_MODES_HZ = np.geomspace(25.0, 320.0, 30)  # a frame's ringing is some periods long: steps of 9 %
_SKEW = 5e-4  # between two recorders of which one is timed by software
_SETTLING_S = (1.5, 3.0, 6.0, 12.0)


def spring_effects(
    rig: RigTable, extension: Sequence[Floats], rates: Sequence[Floats], runs: Sequence[Prepared], most_N: float
) -> list[Term]:
    """The columns, in N. `extension` [m] and `rates` [m/s] are [blocks of the run] each; `most_N` is the largest force."""
    stiffness = rig.drive_stiffness_N_per_m or 0.0
    pull = [stiffness * e for e in extension]
    damping_Ns_per_m = _DAMPING * 2.0 * math.sqrt(stiffness * rig.mass_kg)
    return [
        term("drive-stiffness", "", extension, 0.2 * stiffness, 0, "difference_N_per_m"),
        term("drive-damping", "linear", rates, damping_Ns_per_m, 1, "damping_Ns_per_m"),
        *(
            term("drive-damping", f"relaxing in {1e3 * time_s:g} ms", [low_pass(v, time_s) for v in rates],
                 damping_Ns_per_m, 1, "damping_Ns_per_m")
            for time_s in _RELAXES_S
        ),
        *_late(pull),
        *_bent(pull, most_N),
        *_held(stiffness, extension, most_N),
        *(
            term("frame-compliance", f"{each_Hz:.3g} Hz", [p - mode(p, each_Hz, 0.02) for p in pull], 0.2, 1, "ratio")
            for each_Hz in _MODES_HZ.tolist()
        ),
        *_drifting(runs, most_N),
        *_clocks(stiffness, rates),
    ]  # fmt: skip


def _late(pull: Sequence[Floats]) -> list[Term]:
    """A force that comes late: dead time, or one to three equal low-passes. The coefficient is the delay in s."""
    terms = [
        term(
            "force-sensor-delay",
            f"{1e3 * time_s:g} ms",
            [(delayed(p, time_s) - p) / time_s for p in pull],
            3e-3,
            1,
            "delay_s",
        )
        for time_s in _DELAYS_S
    ]
    for order in (1, 2, 3):
        for time_s in _LAGS_S:
            late = [(_slow(p, order, time_s) - p) / time_s for p in pull]
            terms.append(term("force-sensor-lag", f"order {order}, {1e3 * time_s:g} ms", late, 3e-3, 1, "lag_s"))
    return terms


def _slow(values: Floats, order: int, time_s: float) -> Floats:
    for _ in range(order):
        values = low_pass(values, time_s / order)
    return values


def _clocks(stiffness: float, rates: Sequence[Floats]) -> list[Term]:
    """Force and positions from two loggers: clocks that run apart within a run."""
    pulls = [-stiffness * v for v in rates]
    apart = [pull * (np.arange(len(pull)) * BLOCK_S) for pull in pulls]
    return [
        term("logger-clock", "runs apart in each run", apart, _SKEW, 0, "skew"),
    ]


def _bent(pull: Sequence[Floats], most_N: float) -> list[Term]:
    """A spring that gets stiffer, or an amplifier that shows less above a knee. The coefficient is relative."""
    terms = [term("drive-hardening", "cubic", [p * (p / most_N) ** 2 for p in pull], 0.2, 0, "ratio")]
    for width in (0.5, 1.0):
        shape = [p * np.expm1(np.abs(p) / (width * most_N)) / math.expm1(1.0 / width) for p in pull]
        terms.append(term("drive-hardening", f"exponential {width:g}", shape, 0.2, 1, "ratio"))
    for share in _KNEES:
        over = [np.sign(p) * np.maximum(np.abs(p) - share * most_N, 0.0) for p in pull]
        terms.append(term("drive-hardening", f"from {share * most_N:.3g} N", over, 0.3, 1, "ratio"))
        terms.append(term("force-amplifier", f"from {share * most_N:.3g} N", over, 0.3, -1, "ratio"))
    return terms


def _held(stiffness: float, extension: Sequence[Floats], most_N: float) -> list[Term]:
    """What holds on to the extension: a gap around no force, a clamp that slips beyond a yield."""
    pull = [stiffness * e for e in extension]
    terms = [
        term(
            "drive-backlash",
            f"over {share * most_N:.2g} N",
            [-np.tanh(p / (share * most_N)) for p in pull],
            0.1 * most_N,
            1,
            "half_gap_N",
        )
        for share in _EDGES
    ]
    for share in _YIELDS:
        slider = [-stiffness * play(e, share * most_N / stiffness) for e in extension]
        terms.append(term("loose-clamp", f"yields at {share * most_N:.2g} N", slider, 0.2, 1, "share"))
    return terms


def _drifting(runs: Sequence[Prepared], most_N: float) -> list[Term]:
    """A zero of the force sensor that moves, anew in each run or on and on. The coefficient is in N."""
    times_s = [(np.arange(len(run.commands.drive)) + 0.5) * BLOCK_S for run in runs]
    whole = [t + run.before_s for t, run in zip(times_s, runs, strict=True)]
    total_s = max(float(t[-1]) for t in whole)
    longest_s = max(float(t[-1]) for t in times_s)
    terms: list[Term] = []
    for name, times, length_s in (("in each run", times_s, longest_s), ("since the first run", whole, total_s)):
        spread = 0.1 * most_N
        terms.append(term("force-sensor-drift", f"linear {name}", [t / length_s for t in times], spread, 0, "drift_N"))
        for time_s in _SETTLING_S if times is times_s else (0.3 * total_s, total_s):
            settled = [-np.expm1(-t / time_s) for t in times]
            terms.append(
                term("force-sensor-drift", f"settling in {time_s:.3g} s {name}", settled, spread, 0, "drift_N")
            )
    return terms
