"""Which fits come close to the best one, and starts of the effects of a pair, each alone."""

from diagnosis.fits.fit import Fit
from diagnosis.fits.refits import Start
from diagnosis.hypotheses.hypothesis import Hypothesis


def alone(pairs: list[Fit]) -> list[Start]:
    """Starts for each effect of the best pair alone, at its values in the pair."""
    if not pairs:
        return []
    best = min(pairs, key=lambda fit: fit.chi2)
    starts: list[Start] = []
    for name, form in best.hypothesis.forms.items():
        indices = [i for i, coordinate in enumerate(best.hypothesis.coordinates) if coordinate.effect == name]
        starts.append(
            (
                Hypothesis({name: form}, tuple(best.hypothesis.coordinates[i] for i in indices)),
                best.deviations,
                best.w[indices],
            )
        )
    return starts


def close(baseline: Fit, fits: list[Fit], share: float) -> list[Fit]:
    """The fits that close more than this share of what the best one, the first, closes of the baseline's chi2."""
    return [fit for fit in fits if baseline.chi2 - fit.chi2 > share * (baseline.chi2 - fits[0].chi2)]
