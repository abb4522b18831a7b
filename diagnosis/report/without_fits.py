"""A diagnosis from relations and latent friction alone, if no fit can compare the runs or the budget is too short."""

import math
import time

from diagnosis.features.segments import SHORTEST_S
from diagnosis.gap.measure import DEFINITION
from diagnosis.gap.prepare import Prepared
from diagnosis.result import Candidate, Diagnosis, Experiment, Gap
from diagnosis.verdict.judge import Verdict
from plant.effects.library import EFFECTS

HOLD = Experiment(
    f"Hold each speed and each vibration for {SHORTEST_S:g} s or more in some runs.",
    "No simulated fit compares a command that changes all the time.",
    None,
)
LONGER = Experiment("Diagnose the same runs with a longer --budget.", "No effect was fitted in this time.", None)


def comparable(runs: list[Prepared]) -> bool:
    """Whether any fitted run has a segment that simulated fits can compare."""
    return any(run.commands.segments for run in runs if not run.holdout)


def unfitted() -> Verdict:
    """The verdict before any result: all explanations have the same probability."""
    names = (*EFFECTS, "none", "unexplained")
    return Verdict(
        "unexplained",
        None,
        dict.fromkeys(("unexplained", *names), 1.0 / len(names)),
        runner_up=None,
        ranked=(),
        scale=1.0,
    )


def without_fits(verdict: Verdict, runs: list[Prepared], following: Experiment, began: float) -> Diagnosis:
    """The diagnosis of a verdict without any fit, still without relations, shares and sentences."""
    return Diagnosis(
        verdict=verdict.kind,
        effects=verdict.names,
        summary=(),
        candidates=tuple(Candidate(name, math.nan) for name in dict.fromkeys((*verdict.names, "unexplained", "none"))),
        not_distinguishable=(),
        where=(),
        gap=Gap(DEFINITION, tuple(run.file for run in runs if run.holdout)),
        next_experiment=following,
        rig=(),
        findings=(),
        pictures=(),
        compared_features=0,
        elapsed_s=round(time.monotonic() - began, 2),
    )
