"""Diagnose rigs under random protocols, with other speeds, reversals, vibrations and durations than the blind check.

Without a gap, or with one effect at its full strength, which not every protocol can show: backlash needs a reversal.
"""

import argparse
import tempfile
from pathlib import Path

import joblib
import numpy as np

from diagnosis.diagnose import diagnose
from diagnosis.evidence.folder import load_evidence
from diagnosis.result import Diagnosis
from tests.blind.generator.runs import Plan as RunPlan
from tests.blind.generators import Plan
from tests.blind.independent_cases import Independent

BACKBONES = ("lugre", "lugre", "multi-element", "lugre", "lugre", "lorentzian", "lugre", "lugre", "stretched")


def drawn_protocol(random: np.random.Generator) -> tuple[RunPlan, ...]:
    """Three or four runs, the last one held out; the first moves evenly, the others may reverse or vibrate."""
    runs: list[RunPlan] = []
    count = int(random.integers(3, 5))
    duration_s = float(random.choice([5.0, 8.0, 12.0]))
    for number in range(count):
        speed_mps = float(10.0 ** random.uniform(-3.9, -2.5))
        drive, vibration = [(0.0, speed_mps)], []
        kind = random.choice(["even", "reversed", "shaken", "shaken"]) if number else "even"
        if kind == "reversed":
            drive.append((duration_s * random.uniform(0.3, 0.6), -speed_mps * random.uniform(0.5, 2.0)))
        elif kind == "shaken":
            begins_s = np.linspace(0.2, 1.0, int(random.integers(2, 5)))[:-1] * duration_s
            vibration = [(float(begin_s), float(round(10.0 ** random.uniform(2.6, 3.7)))) for begin_s in begins_s]
        runs.append(RunPlan(tuple(drive), tuple(vibration), holdout=number == count - 1, duration_s=duration_s))
    return tuple(runs)


def diagnosed(number: int, seed: int, with_effect: bool) -> tuple[str, Diagnosis]:
    """The effect of a case, or "none", and its diagnosis."""
    random = np.random.default_rng([seed, number])
    source = Independent(drawn_protocol(random))
    names = sorted(source.library)
    effects = (source.draw(random, names[number % len(names)]),) if with_effect else ()
    with tempfile.TemporaryDirectory() as folder:
        plan = Plan(effects=effects, backbone=BACKBONES[number % len(BACKBONES)])
        source.make(Path(folder), plan, int(random.integers(2**31)))
        return effects[0].name if effects else "none", diagnose(load_evidence(Path(folder)), lambda *_: None)


parser = argparse.ArgumentParser(prog="python -m tests.blind.other_protocols", description=__doc__)
parser.add_argument("--cases", type=int, default=40)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--effects", action="store_true", help="one effect each, in place of none")
parser.add_argument("--jobs", type=int, default=joblib.cpu_count())

if __name__ == "__main__":
    arguments = parser.parse_args()
    work = (joblib.delayed(diagnosed)(number, arguments.seed, arguments.effects) for number in range(arguments.cases))
    right = 0
    for number, (truth, diagnosis) in enumerate(joblib.Parallel(arguments.jobs, return_as="generator")(work)):
        verdict = " + ".join(diagnosis.effects) or ("none" if diagnosis.verdict == "no-gap" else diagnosis.verdict)
        groups = [" or ".join(group) for group in diagnosis.not_distinguishable if truth in group]
        right += truth == verdict
        print(f"{number:4d}  {truth:28s} {verdict:40s} {', '.join(groups)}", flush=True)
    print(f"right: {right} of {arguments.cases}")
