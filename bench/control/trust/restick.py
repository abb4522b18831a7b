"""Delay of the announcement of a re-stick on the paper's rig, and false announcements."""

import statistics

import numpy as np

from bench.control import record
from bench.control.figures import figures
from bench.control.rules import CONTROLLER
from bench.control.run import Subject, judge
from bench.control.scenario import BankScenario, changed, load_bank
from bridge.wire.stickslip_pb2 import STICK
from cockpit.run.closed_loop import Stretch

_PAPER = "pair-c45-0.5"
_STICK_SLIP_S, _SMOOTH_S = 60.0, 300.0  # durations of the runs of the paper's rig, and of the family `false`
_FREE_MPS = {"free-0.5": 5e-4, "free-0.2": 2e-4, "free-0.1": 1e-4}
_LATE_BLOCKS = 2  # blocks after a stick's end in which its announcement still counts
_GRACE_S = 0.05  # time around a true stick in which a state STICK is not false: the slide slows down before it


def restick_runs() -> list[BankScenario]:
    """The paper's rig, never vibrated, then held; then the family `false`, shortened.

    Each stick after a slip is a re-stick. Under a vibration that is too weak the controller ends the vibration, so that no
    stick of the paper's rig begins in EXCITE.
    """
    bank = load_bank()
    paper = next(scenario for scenario in bank if scenario.name == _PAPER)
    free = {"controller": {"policy": {"enabled_from_s": _STICK_SLIP_S}}}
    tables = {name: free | {"rig": {"drive": {"profile": [[0.0, v_d]]}}} for name, v_d in _FREE_MPS.items()}
    tables["held-0.5"] = {}
    return [
        *(changed(paper, name, _STICK_SLIP_S, table) for name, table in tables.items()),
        *(changed(scenario, scenario.name, _SMOOTH_S, {}) for scenario in bank if scenario.family == "false"),
    ]


def restick_figures(scenario: BankScenario) -> dict[str, float]:
    """Re-sticks with and without announcement, their median delay, and false announcements of one run."""
    states: list[np.ndarray] = []

    def observe(made: Stretch) -> None:
        states.append(made.trace["state"] == STICK)

    judged = judge(scenario, Subject(CONTROLLER), observe=observe)
    if scenario.family == "false":
        claims = figures(scenario, "controller", judged, is_controller=True).false_claims
        return {"simulated_s": judged.duration_s, "false": claims}
    sticks = judged.events[judged.events[:, 0] == record.STUCK, 1:3]
    last_s = sticks[-1, 1] + _GRACE_S  # a later stick has not ended, and is not in the record
    is_stick, block_s = np.concatenate(states), scenario.rig.solver.block_s
    times_s = (np.arange(len(is_stick)) + 1) * block_s
    steps_s, begins_s = times_s[is_stick], times_s[is_stick & ~np.concatenate([[False], is_stick[:-1]])]
    delays_s: list[float] = []
    for begin_s, end_s in sticks[1:]:  # the first is the start of the drive
        inside = steps_s[(steps_s >= begin_s) & (steps_s <= end_s + _LATE_BLOCKS * block_s)]
        delays_s += [float(inside[0] - begin_s)] if len(inside) else []
    begins_s = begins_s[begins_s < last_s]
    near = (begins_s[:, None] > sticks[:, 0] - _GRACE_S) & (begins_s[:, None] < sticks[:, 1] + _GRACE_S)
    return {
        "simulated_s": judged.duration_s,
        "sticks": len(sticks[1:]),
        "announced": len(delays_s),
        "delay_median_s": statistics.median(delays_s) if delays_s else -1.0,
        "false": int((~near.any(axis=1)).sum()),
    }
