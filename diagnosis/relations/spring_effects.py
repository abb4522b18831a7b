"""The columns of the spring relation: the force that each effect of spring, clamp, frame and force sensor adds."""

import math
from collections.abc import Sequence

import numpy as np

from diagnosis.evidence.manifest import RigTable
from diagnosis.features.grid import BLOCK_S
from diagnosis.gap.prepare import Prepared
from diagnosis.model.sensor_chain import delayed, low_pass
from diagnosis.relations.relation import LARGE, SETTLES, SKEW, Floats, Term, term
from diagnosis.relations.shapes import MODES_HZ, mode

_TIMES_S = np.geomspace(3e-4, 8e-3, 8)  # dead times and lags: steps of 60 %
_KNEES = (0.3, 0.4, 0.5, 0.57, 0.64, 0.71, 0.78, 0.85, 0.92)  # of the largest force
_EDGES = (0.02, 0.05, 0.1)  # softness of a backlash, of the largest force


def spring_effects(
    rig: RigTable, extension: Sequence[Floats], rates: Sequence[Floats], runs: Sequence[Prepared], most_N: float
) -> list[Term]:
    """The columns, in N. `extension` [m] and `rates` [m/s] are [blocks of the run] each; `most_N` is the largest force."""
    stiffness = rig.drive_stiffness_N_per_m or 0.0
    pull = [stiffness * e for e in extension]
    damping_Ns_per_m = LARGE * 2.0 * math.sqrt(stiffness * rig.mass_kg)
    return [
        term("drive-stiffness", "", extension, 0.2 * stiffness, 0, "difference_N_per_m"),
        term("drive-damping", "linear", rates, damping_Ns_per_m, 1, "damping_Ns_per_m"),
        *(
            term("drive-damping", f"relaxing in {1e3 * time_s:.2g} ms", [low_pass(v, time_s) for v in rates],
                 damping_Ns_per_m, 1, "damping_Ns_per_m")
            for time_s in _TIMES_S.tolist()[-3:]  # a shorter one is a damping without memory
        ),
        *_late(pull),
        *_bent(pull, most_N),
        *(
            term("drive-backlash", f"over {share * most_N:.2g} N", [-np.tanh(p / (share * most_N)) for p in pull],
                 LARGE * most_N, 1, "half_gap_N")
            for share in _EDGES
        ),
        *(
            term("frame-compliance", f"{each_Hz:.3g} Hz", [p - mode(p, each_Hz, 0.02) for p in pull], 0.2, 1, "ratio")
            for each_Hz in MODES_HZ.tolist()
        ),
        *_drifting(runs, most_N),
        # force and positions from two loggers, whose clocks run apart within a run
        term("logger-clock", "runs apart in each run",
             [-stiffness * v * (np.arange(len(v)) * BLOCK_S) for v in rates], SKEW, 0, "skew"),
    ]  # fmt: skip


def _late(pull: Sequence[Floats]) -> list[Term]:
    """A force that comes late: dead time, or one to three equal low-passes. The coefficient is the delay in s."""
    terms: list[Term] = []
    for time_s in _TIMES_S.tolist():
        late = [(delayed(p, time_s) - p) / time_s for p in pull]
        terms.append(term("force-sensor-delay", f"{1e3 * time_s:.2g} ms", late, 3e-3, 1, "delay_s"))
        for order in (1, 2, 3):
            slow = [(_slow(p, order, time_s) - p) / time_s for p in pull]
            terms.append(term("force-sensor-lag", f"order {order}, {1e3 * time_s:.2g} ms", slow, 3e-3, 1, "lag_s"))
    return terms


def _slow(values: Floats, order: int, time_s: float) -> Floats:
    for _ in range(order):
        values = low_pass(values, time_s / order)
    return values


def _bent(pull: Sequence[Floats], most_N: float) -> list[Term]:
    """A spring that gets stiffer. The coefficient is relative."""
    terms = [term("drive-hardening", "cubic", [p * (p / most_N) ** 2 for p in pull], 0.2, 0, "ratio")]
    for width in (0.5, 1.0):
        shape = [p * np.expm1(np.abs(p) / (width * most_N)) / math.expm1(1.0 / width) for p in pull]
        terms.append(term("drive-hardening", f"exponential {width:g}", shape, 0.2, 1, "ratio"))
    for share in _KNEES:
        over = [np.sign(p) * np.maximum(np.abs(p) - share * most_N, 0.0) for p in pull]
        terms.append(term("drive-hardening", f"from {share * most_N:.3g} N", over, 0.3, 1, "ratio"))
    return terms


def _drifting(runs: Sequence[Prepared], most_N: float) -> list[Term]:
    """A zero of the force sensor that moves, in each run again or steadily. The coefficient is in N."""
    times_s = [(np.arange(len(run.commands.drive)) + 0.5) * BLOCK_S for run in runs]
    whole = [t + run.before_s for t, run in zip(times_s, runs, strict=True)]
    total_s = max(float(t[-1]) for t in whole)
    longest_s = max(float(t[-1]) for t in times_s)
    terms: list[Term] = []
    for name, times, length_s in (("in each run", times_s, longest_s), ("since the first run", whole, total_s)):
        shapes = {"linear": [t / length_s for t in times]}
        for time_s in [length_s * share for share in SETTLES]:
            shapes[f"settling in {time_s:.3g} s"] = [-np.expm1(-t / time_s) for t in times]
        for how, shape in shapes.items():
            terms.append(term("force-sensor-drift", f"{how} {name}", shape, LARGE * most_N, 0, "drift_N"))
    return terms
