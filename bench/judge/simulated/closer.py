"""A closer look at names that the witnesses leave close: each effect is refitted, as linear estimates cannot part them."""

import math

from bench.judge.simulated.witnesses import Baseline, Witnesses
from diagnosis.fits.batch import together
from diagnosis.fits.screening import screened

_MOST = 3  # effects that are refitted. More: time, 1 to 3 s each
# Rows of evidence in a compared feature: chi2 that a perfect model leaves. Larger: small differences decide.
_ROWS = 0.25
# Log odds that refits change at most; only effects that can still win are refitted. Larger: refits overrule all other witnesses.
# Smaller: they do not decide.
_ADDS = 3.0


def closer(baseline: Baseline, names: dict[str, float], witnesses: Witnesses) -> dict[str, float]:
    """The probabilities `names` after refits of the close effects, which share their sum."""
    tried = {trial.hypothesis.effects[0] for trial in baseline.trials}
    least = max(names.values()) * math.exp(-_ADDS)
    close = sorted((name for name in names.keys() & tried if names[name] > least), key=lambda name: -names[name])
    if len(close) < 2:
        return names
    fitter, fit = baseline.fitter, baseline.fit
    screenings = [
        screened(fitter, fit, [trial for trial in baseline.trials if trial.hypothesis.effects[0] == name], paired=False)
        for name in close[:_MOST]
    ]
    best = [screening.singles[0] for screening in screenings if screening.singles]
    fits = together(
        fitter.predicted_many, [fitter.refitting(start.hypothesis, start.deviations, start.w) for start in best]
    )
    rows = _ROWS * len(fit.residual)
    # the noise is unknown: a model is judged by the logarithm of its chi2
    evidence: dict[str, float] = {}
    for start, refit in zip(best, fits, strict=True):
        (name,) = start.hypothesis.effects
        # no refit sees the channels as finely as a relation
        relations = [
            value for key, value in witnesses.items() if key.startswith("relation ") and key.endswith(f" {name}")
        ]
        evidence[name] = max(relations, default=0.0) - 0.5 * rows * math.log(refit.chi2)
    most = max(evidence.values())
    weights = {name: names[name] * math.exp(max(value - most, -_ADDS)) for name, value in evidence.items()}
    share = sum(names[name] for name in weights) / sum(weights.values())
    return names | {name: weight * share for name, weight in weights.items()}
