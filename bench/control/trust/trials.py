"""Cost of the trials without vibration, on drawn axes that need it: slips and surges in long runs."""

import numpy as np

from bench.control.drawn import drawn_axes
from bench.control.rules import CONTROLLER
from bench.control.run import Subject, judge, of_trials, wrong_from
from bench.control.scenario import BankScenario, changed
from bridge.wire.stickslip_pb2 import PROBE

_HELD_S = 60.0  # time in which the controller learns that vibration is needed; at most half of the run


def long_axes(seed: int, count: int, duration_s: float) -> list[BankScenario]:
    """Drawn axes that run for longer, with sensors for the longer travel."""

    def longer(axis: BankScenario) -> BankScenario:
        travel_m = max(axis.rig.drive.speeds_mps()) * duration_s
        sensors = {"position_range_m": 0.05 + 1.1 * travel_m, "position_linearity": 0.0}
        table = {} if axis.rig.drive.repeat_every_s else {"rig": {"sensors": sensors}}
        return changed(axis, axis.name, duration_s, table)

    return [longer(axis) for axis in drawn_axes(seed, count)]


def trial_figures(scenario: BankScenario) -> dict[str, float]:
    """Number of trials, and of slips and surges in them and outside of them, once held."""
    probes: list[np.ndarray] = []
    judged = judge(scenario, Subject(CONTROLLER), observe=lambda made: probes.append(made.trace["mode"] == PROBE))
    from_s = min(_HELD_S, 0.5 * scenario.duration_s)
    probe = np.concatenate(probes)[round(from_s / scenario.rig.solver.block_s) :]
    in_trials = int((of_trials(judged.events) & (judged.events[:, 1] > from_s)).sum())
    return {
        "trials": int((probe[1:] & ~probe[:-1]).sum()),
        "in_trials": in_trials,
        # the first minute counts as motion, as the time to the first counted trial begins in it
        "in_trials_per_600_s": in_trials * 600.0 / judged.sums["moving_s"],
        "wrong": int(wrong_from(judged.events, from_s).sum()),
    }
