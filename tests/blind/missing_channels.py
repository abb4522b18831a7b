"""Diagnose rigs with one effect at its full strength whose logs lack channels.

The diagnosis should give an answer, with wider groups, and never a wrong answer that is sure. A log without these channels may
not show the effect at all; then no gap is the right answer.
"""

import argparse
import tempfile
from pathlib import Path

import joblib
import numpy as np

from diagnosis.diagnose import diagnose
from diagnosis.evidence.folder import load_evidence
from diagnosis.result import Diagnosis
from tests.blind.generators import Plan
from tests.blind.independent_cases import Independent

MISSING = {
    # the drive position stays: without it a run whose drive velocity changes cannot be read
    "force and drive only": ("mass_accel_mps2", "base_accel_mps2", "mass_position_m"),
    "no acceleration of the base": ("base_accel_mps2",),
    "no displacement of the slide": ("mass_position_m",),
}
SURE = 0.8


def diagnosed(number: int, seed: int) -> tuple[str, str, Diagnosis]:
    """The channels that a case lacks, its effect, and its diagnosis."""
    random = np.random.default_rng([seed, number])
    source = Independent()
    names = sorted(source.library)
    missing = list(MISSING)[number % len(MISSING)]
    effect = source.draw(random, names[number // len(MISSING) % len(names)])
    with tempfile.TemporaryDirectory() as folder:
        source.make(
            Path(folder), Plan((effect,), leave_out=MISSING[missing], backbone="lugre"), int(random.integers(2**31))
        )
        return missing, effect.name, diagnose(load_evidence(Path(folder)), lambda *_: None)


parser = argparse.ArgumentParser(prog="python -m tests.blind.missing_channels", description=__doc__)
parser.add_argument("--cases", type=int, default=78, help="three for each of 26 effects")
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--jobs", type=int, default=joblib.cpu_count())

if __name__ == "__main__":
    arguments = parser.parse_args()
    counts = {
        missing: dict.fromkeys(("named", "in group", "no gap", "unexplained", "wrong", "sure and wrong"), 0)
        for missing in MISSING
    }
    sizes: dict[str, list[int]] = {missing: [] for missing in MISSING}
    work = (joblib.delayed(diagnosed)(number, arguments.seed) for number in range(arguments.cases))
    for number, (missing, truth, diagnosis) in enumerate(joblib.Parallel(arguments.jobs, return_as="generator")(work)):
        group = {*diagnosis.effects, *(name for names in diagnosis.not_distinguishable for name in names)}
        outcome = {"no-gap": "no gap", "unexplained": "unexplained"}.get(diagnosis.verdict)
        if outcome is None:
            outcome = "named" if truth in diagnosis.effects else "in group" if truth in group else "wrong"
            sizes[missing].append(len(group))
        counts[missing][outcome] += 1
        counts[missing]["sure and wrong"] += (
            outcome == "wrong" and diagnosis.complete * diagnosis.candidates[0].probability > SURE
        )
        print(f"{number:4d}  {missing:28s} {truth:28s} {outcome:12s} {' or '.join(sorted(group))}", flush=True)
    for missing, own in counts.items():
        size = float(np.mean(sizes[missing] or [0]))
        print(f"{missing}: {', '.join(f'{outcome} {count}' for outcome, count in own.items())}; mean group {size:.2f}")
