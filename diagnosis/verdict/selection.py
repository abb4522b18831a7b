"""Which effect explains the fitted runs: refits, the more the less is explained, until a verdict stands.

What the relations decide is no longer asked: effects that their relation does not show are not tried, those that it shows are
refitted first, and where it shows something that the library lacks no further effect is looked for.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from diagnosis.fits.expected import NEVER_WITHOUT_GAP, hidden_by_noise, much_left
from diagnosis.fits.fit import Fit
from diagnosis.fits.gauss_newton import Fitter
from diagnosis.fits.late_friction import EFFECT as LAG
from diagnosis.fits.late_friction import late_fits
from diagnosis.fits.load_phases import starts_by_run
from diagnosis.fits.random_friction import RANDOM_EFFECTS, RandomFriction
from diagnosis.fits.refits import Start, best_of_each, each_beside, refits
from diagnosis.fits.refloored import on_floor_of
from diagnosis.fits.restarts import alone, close
from diagnosis.fits.retuning import Retuned
from diagnosis.fits.screening import screened
from diagnosis.fits.search import middle_fits, pairs_of_effects, refitted, refitted_rest
from diagnosis.hypotheses.hypothesis import NOTHING
from diagnosis.hypotheses.starts import Trial
from diagnosis.verdict.judge import COST_OF_EFFECT, JITTER, Verdict, judge, of_another_place, refittable

Progress = Callable[[str, float], None]
# log evidence from which a name is not checked: a guess, as the one check seen to overturn a name took 8 to -7
_SURE = COST_OF_EFFECT + 14.0
_CHECKS = 3  # names that may fall one after the other
_LEADING = 2  # fits that are refitted further: one that was not had a second effect named for what it left
# Of what is above the expected: a path that varies at random has a strongest wave. Two that were drawn had one of 38 and 64 %, a
# load whose wave began anew in every run one of 7.7 %; a clock that ran fast, a coupling that slipped and a loose plug, which a
# path that free would take for scatter, 1 to 3 %.
_STRONGEST_WAVE = 0.05
# Times the expected chi2: right effects whose formula is another leave up to 2.5 (but one, seen by the force alone, 28), a gain
# of the force sensor that stood for a Coulomb friction never tried left 5.5. What is searched then takes as long as all before.
_DOUBTFUL = 3.0
_LATE = 0.3  # share of what the best effect closes, from which friction that lags is looked for at other dead times
_NEAR = 0.6  # of the gap: of 11 effects outside the library the best single one closed 0.08 to 0.42
# of chi2 that the best single effect takes, of two that show one takes more; and that it leaves above the expected, as a second
# effect that takes less would not pay
_WORTH_MORE = 40.0
# Of chi2: where the rig without effects leaves no more than a right one, a fit that has taken less in two steps ends there. An
# effect is named only for twice that. Smaller: time. Larger: a bent effect, of which two steps see little, would be passed over.
_HALF_A_NAME = JITTER * COST_OF_EFFECT


class Hints(NamedTuple):
    """What the relations say before any fit."""

    hinted: frozenset[str] = frozenset()  # effects of the library that they show
    outside: bool = False  # whether they show something that the library lacks


class Contest:
    """Effects of the library, alone and in pairs, against each other and the rig without effects.

    Attributes:
        rig: the rig without effects, on the floors that all is fitted on; it may be found better on the way.
        singles, pairs: the best fit of each effect and pair, the best first.
        random: friction that varies at random, where it was asked for.
        verdict: over all of them, once `decide` is through.

    """

    def __init__(self, rig: Retuned, tried: list[Trial], jobs: int, known: Hints = Hints()) -> None:  # noqa: B008
        self.rig = rig
        self.singles: list[Fit] = []
        self.pairs: list[Fit] = []
        self.random: list[RandomFriction] = []
        self._overturned = False  # a check has taken a name back: the pairs, which hold it as it was, compete no more
        self.verdict = self._judged()
        self._tried = tried
        self._jobs = jobs
        self._known = known

    def decide(self, progress: Progress) -> None:
        """Go on until a verdict stands. `progress` is told what is known and the share of the whole diagnosis that is done."""
        self._fit_singles(progress)
        if self._known.outside:
            return
        self._fit_pairs(progress)
        named, doubtful = self.verdict.named, _DOUBTFUL * self.rig.expected_chi2
        if self.verdict.kind == "unexplained" or (named is not None and named.chi2 > doubtful):
            self._try_everything(progress)
        if self._may_scatter():
            progress("testing whether the remainder is friction that varies at random", 0.75)
            self.random = self._random_frictions()
            self.verdict = self._judged()
        self.check()
        nearest = self._nearest()
        if self.verdict.kind == "unexplained" and nearest is not None:
            progress(
                "no effect explains it with the noise floors of the baseline: repeat with the floors of the nearest model",
                0.77,
            )
            self._contest_on_floor_of(nearest)

    def stop(self) -> None:
        """End where the time is over: the verdict over the fits so far."""
        self.verdict = self._judged()

    def check(self) -> None:
        """Let a name of little evidence stand up to several refits, or fall."""
        verdict = self.verdict
        self.singles, self.verdict = checked(self.rig, self.singles, self.random, verdict, self._jobs)
        self._overturned = self.verdict is not verdict

    def refuted(self) -> Verdict:
        """The verdict where the held-out runs do not bear out what is named."""
        return self._judged(refuted=True)

    def without_random(self) -> Verdict:
        """The verdict where they do not scatter as friction that varies at random would make them."""
        self.random = []
        self.verdict = self._judged()
        return self.verdict

    def elsewhere(self) -> Verdict | None:
        """The verdict where they have another place of the track than its waves were fitted to."""
        paths = self.random or self._random_frictions()
        return of_another_place(self.rig.fit, self.singles, self.rig.expected_chi2, paths)

    def _fit_singles(self, progress: Progress) -> None:
        """The leading effects, each from the most promising start."""
        fitter, jobs = self.rig.fitter, self._jobs
        self._screening = screened(fitter, self.rig.fit, self._tried, jobs)
        progress("every effect was tried once; the leading ones are fitted", 0.35)
        at_noise = not self._known.hinted and self.rig.fit.chi2 <= self.rig.expected_chi2
        least = _HALF_A_NAME if at_noise else 0.0
        refits = refitted(fitter, self.rig.fit.chi2, self._screening, self._known.hinted, jobs, least)
        self.singles = self._finished(refits)
        if self._shows_more():
            # an effect must not win because its refit found a valley of the nuisances that the others had missed
            again = fitter.refit(NOTHING, self.singles[0].deviations, np.zeros(0))
            self.rig = self.rig._replace(fit=min(self.rig.fit, again, key=lambda fit: fit.chi2))
        self.verdict = self._judged()

    def _fit_pairs(self, progress: Progress) -> None:
        """A second effect beside the best ones, if they leave more than a perfect model would."""
        if not self._shows_more() or self.singles[0].chi2 - self.rig.expected_chi2 < _WORTH_MORE:
            return
        progress(f"best single effect so far: {self.singles[0].hypothesis.effects[0]}; looking for a second", 0.6)
        pairs = pairs_of_effects(self.rig.fitter, self.singles, self._screening, self._tried, self._jobs)
        self.pairs = self._finished(_with(self.pairs, pairs))
        self.singles = self._again(self.singles, alone(self.pairs))
        self.verdict = self._judged()

    def _try_everything(self, progress: Progress) -> None:
        """Every form of every effect, alone and beside the best one."""
        fitter, jobs = self.rig.fitter, self._jobs
        progress("nothing explains it well yet: every effect gets a refit", 0.65)
        best = self._best()
        self.singles = _with(self.singles, refitted_rest(fitter, self.rig.fit, self.singles, self._tried, jobs))
        if self._varies():
            by_run = starts_by_run(fitter, self.rig.fit, self._tried, jobs)
            self.singles = self._finished(self._again(self.singles, by_run))
        if any(fit.hypothesis.effects == (LAG,) for fit in close(self.rig.fit, self.singles, _LATE)):
            self.singles = self._finished(_with(self.singles, late_fits(fitter, self._tried, jobs)))
        self.verdict = self._judged()
        if self._best() is not best and self._leaves_much(self._best()):
            self._fit_pairs(progress)

    def _best(self) -> Fit:
        """The single effect that leaves least, or the rig without effects."""
        return self.singles[0] if self.singles else self.rig.fit

    def _contest_on_floor_of(self, nearest: Fit) -> None:
        """The leading effects on the floors of the model that comes nearest; what they were stays where none is named there."""
        rig, singles, pairs = on_floor_of(nearest, self.rig, self.singles, self.pairs, self._jobs)
        new_verdict = judge(rig.fit, singles, pairs, rig.expected_chi2)
        singles, verdict = checked(rig, singles, [], new_verdict, self._jobs)
        if verdict.named is not None:
            self._overturned = verdict is not new_verdict
            self.rig, self.singles, self.pairs, self.random, self.verdict = rig, singles, pairs, [], verdict

    def _may_scatter(self) -> bool:
        """Whether what is left may be friction that varies at random: rigs without a gap leave scatter too."""
        never = NEVER_WITHOUT_GAP * self.rig.expected_chi2
        if self.rig.fit.chi2 <= never or hidden_by_noise(self.rig.fit, self.rig.expected_chi2) or not self._varies():
            return False
        left = min(fit.chi2 for fit in (self.rig.fit, *self.singles, *self.pairs))
        return self.verdict.kind == "unexplained" or left > never

    def _varies(self) -> bool:
        """Whether a wave of the friction, over time or along the track, takes a share of the gap."""
        waves = [fit.chi2 for fit in self.singles if fit.hypothesis.effects[0] in RANDOM_EFFECTS]
        return self.rig.fit.chi2 - min(waves, default=math.inf) >= _STRONGEST_WAVE * self._gap()

    def _random_frictions(self) -> list[RandomFriction]:
        """The random form of each effect that has one, on the rig that comes nearest without that effect."""
        randoms: list[RandomFriction] = []
        for effect in RANDOM_EFFECTS:
            others = [self.rig.fit, *(fit for fit in self.singles if effect not in fit.hypothesis.effects)]
            randoms.append(RandomFriction(effect, self.rig.fitter, min(others, key=lambda fit: fit.chi2)))
        return randoms

    def _nearest(self) -> Fit | None:
        """The model that leaves least, if it comes near."""
        nearest = min((*self.singles[:1], *self.pairs[:1]), key=lambda fit: fit.chi2, default=self.rig.fit)
        return nearest if self._is_near(nearest) else None

    def _is_near(self, fit: Fit) -> bool:
        """Whether a model closes so much that the measured rig is like it."""
        return self.rig.fit.chi2 - fit.chi2 > _NEAR * self._gap() > 0.0

    def _shows_more(self) -> bool:
        """Whether the best single effect takes so much that there may be more."""
        return bool(self.singles) and self.rig.fit.chi2 - self.singles[0].chi2 > _WORTH_MORE

    def _gap(self) -> float:
        """What the rig without effects leaves above the expected, of chi2."""
        return self.rig.fit.chi2 - self.rig.expected_chi2

    def _leaves_much(self, fit: Fit) -> bool:
        return much_left(fit, self.rig.expected_chi2)

    def _judged(self, refuted: bool = False) -> Verdict:
        pairs = [] if self._overturned else self.pairs
        return judge(self.rig.fit, self.singles, pairs, self.rig.expected_chi2, self.random, refuted)

    def _finished(self, fits: list[Fit]) -> list[Fit]:
        """The fits, best first, the leading ones refitted as long as that gains where they leave much."""
        leading = [fit for fit in fits[:_LEADING] if self._leaves_much(fit) and not fit.finished]
        return _with(fits, each_beside(self._jobs, Fitter.going_further, self.rig.fitter, leading))

    def _again(self, fits: list[Fit], starts: list[Start]) -> list[Fit]:
        """Single effects, or pairs, best first, after refits from other starts."""
        return _with(fits, refits(self.rig.fitter, starts, self._jobs))


def checked(
    rig: Retuned, singles: list[Fit], random: list[RandomFriction], verdict: Verdict, jobs: int
) -> tuple[list[Fit], Verdict]:
    """Single effects and the verdict, in which a name of little evidence stands up to the middle of several refits.

    One that does not is set back to its middle fit, and the next one is looked at.
    """
    for _ in range(_CHECKS):
        if not refittable(verdict) or verdict.ranked[0].evidence >= _SURE:
            break
        without, middle = middle_fits(rig.fitter, rig.fit, singles, verdict.ranked[0].fit, jobs)
        if judge(without, [middle], [], rig.expected_chi2).named is not None:
            break
        others = [fit for fit in singles if fit.hypothesis.effects != middle.hypothesis.effects]
        singles = sorted((middle, *others), key=lambda fit: fit.chi2)
        verdict = judge(rig.fit, singles, [], rig.expected_chi2, random)
    return singles, verdict


def _with(fits: list[Fit], more: list[Fit]) -> list[Fit]:
    """All of them, best first; of two as good the one of `more`, which may be marked as finished."""
    return best_of_each(sorted((*more, *fits), key=lambda fit: fit.chi2))
