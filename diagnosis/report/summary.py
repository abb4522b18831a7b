"""The answer of a diagnosis in six lines: effect, how sure, gap closed on held-out runs, other causes, wrong numbers, next."""

import math
from collections.abc import Iterator

from bridge.units import counted, percent, signal_name, times
from diagnosis.evidence.foreign_vibration import DISTORTED, PICK_UP
from diagnosis.fits.held_out import MORE_THAN_RIGHT
from diagnosis.model.per_run import has_own_phases
from diagnosis.report.words import (
    SLOW,
    SLOWLY,
    closed_between,
    closed_in_words,
    headline,
    latent_answer,
    remainder_in_words,
    to_correct,
    wrong_number_in_words,
)
from diagnosis.result import Diagnosis

# gap of the baseline over the gap as described from which a refit makes held-out runs worse, not by chance
_WORSE = 1.1
_SMALL_SHARE = 0.05  # smallest share of the gap of a regime that is reported
_OTHERS = 2  # candidates after the named ones


def summary(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Six lines, the answer first; each but the first begins with its label."""
    others = "; ".join(_others(diagnosis)) or "nothing"
    data = f", and {counted(len(diagnosis.findings), 'finding')} about the data" if diagnosis.findings else ""
    return (
        headline(diagnosis),
        line("sure", "; ".join(_sure(diagnosis))),
        line("held out", "; ".join(_held_out(diagnosis))),
        line("else", others),
        line("numbers", _numbers(diagnosis)),
        line("next", f"{diagnosis.next_experiment.what} `--all` prints relations and shares{data}."),
    )


def line(label: str, text: str) -> str:
    """A line of the answer on the terminal, behind its label."""
    return f"{label:<10} {text}"


def _sure(diagnosis: Diagnosis) -> Iterator[str]:
    """How probable other answers are."""
    if diagnosis.verdict == "not-finished":
        yield "nothing was judged"
        return
    known = [row for row in diagnosis.candidates if math.isfinite(row.probability)]
    shown = {row.effect: f"{row.effect} {percent(row.probability)}" for row in known}
    others = [text for effect, text in shown.items() if effect not in diagnosis.effects]
    by_number = diagnosis.verdict == "described" and not (known and known[0].effect in diagnosis.effects)
    if diagnosis.verdict == "described" and not by_number:
        yield ", ".join(shown[effect] for effect in diagnosis.effects)
    if diagnosis.verdict == "unexplained" and diagnosis.gap.with_effect > MORE_THAN_RIGHT:
        yield f"the held-out runs are {times(diagnosis.gap.with_effect)} noise floors off, more than a right answer leaves"
    elif known and diagnosis.verdict == "unexplained":
        yield f"{percent(1.0 - diagnosis.complete)} that something outside the library acts"
    elif known and any(finding.kind == "budget" for finding in diagnosis.findings):
        yield "the time ended before everything was tried, so whether anything else acts is not judged"
    elif known:
        yield f"{percent(diagnosis.complete)} that nothing else acts"
    if known and not by_number:  # the judge counts a number within its bounds as `none`
        yield f"{'other' if diagnosis.effects else 'leading'} candidates {', '.join(others[:_OTHERS])}"
    for group in diagnosis.not_distinguishable:
        yield f"these runs cannot separate {', '.join(group)}"
    if diagnosis.verdict == "no-gap":
        yield "an effect too small to show here is not excluded"


def _held_out(diagnosis: Diagnosis) -> Iterator[str]:
    """How far the gap closes on the runs that no fit used."""
    gap = diagnosis.gap
    kept = ", ".join(gap.files)
    if not gap.files:
        yield "no run was held out, so how far the gap closes on new data is not known"
    elif not math.isfinite(gap.retuned):
        yield f"{kept} cannot be compared, so how far the gap closes on new data is not known"
    elif gap.shrinkage is not None and gap.with_effect > gap.retuned:
        yield f"{kept}: the gap grows from {times(gap.retuned)} to {times(gap.with_effect)} noise floors"
    elif gap.shrinkage is not None:
        between = f" (90 %: {known})" if (known := closed_between(gap.interval_90)) else ""
        falls = f"{kept}: the gap falls from {times(gap.retuned)} to {times(gap.with_effect)} noise floors (perfect: 1)"
        yield f"{falls}, {closed_in_words(gap.shrinkage)} of it closed{between}"
    else:
        yield f"{kept}: {times(gap.nominal)} noise floors as described, {times(gap.retuned)} refitted (perfect: 1)"
        if diagnosis.effects and diagnosis.verdict != "described" and gap.retuned <= MORE_THAN_RIGHT:
            yield "no gap is left to close there, so new data have not tested the name"
        if diagnosis.verdict == "unexplained" and gap.retuned <= 1.0:
            yield "the gap shows in the fitted runs alone"


def _others(diagnosis: Diagnosis) -> Iterator[str]:
    """Everything else that the runs show."""
    gap = diagnosis.gap
    yield from dict.fromkeys(
        f"{finding.where.partition(': ')[2]}: {finding.text}" for finding in to_correct(diagnosis.findings)
    )
    if diagnosis.verdict in ("partly", "unexplained"):
        yield from [most] if (most := latent_answer(diagnosis)) else []
    if diagnosis.remainder is not None:
        yield remainder_in_words(diagnosis.remainder)
    if diagnosis.effects and gap.shrinkage is not None and gap.with_effect > MORE_THAN_RIGHT:
        yield f"a right explanation leaves about 1 on the held-out runs, not {times(gap.with_effect)}: something else acts too"
    if diagnosis.where and diagnosis.verdict in ("partly", "unexplained", "not-finished"):
        yield _where(diagnosis)
    for row in diagnosis.candidates:
        if row.effect in diagnosis.effects and has_own_phases(row.parameters):
            yield f"the phase of {row.effect} differs from run to run, so on a run of unknown phase it counts as scatter"
    for finding in diagnosis.findings:
        if finding.kind == SLOW:
            yield f"the {finding.where} {SLOWLY}"
    still = [finding.where.partition(":")[0] for finding in diagnosis.findings if finding.kind == "still"]
    if still:
        yield f"in {', '.join(still)} the drive does not move: friction and drive are not tested there"
    for kind in (PICK_UP, DISTORTED):
        vibrating = [finding for finding in diagnosis.findings if finding.kind == kind]
        if vibrating:
            others = ", ".join(finding.where.partition(":")[0] for finding in vibrating[1:])
            yield f"{vibrating[0].where} {vibrating[0].text}" + (f", also {others}" if others else "")


def _numbers(diagnosis: Diagnosis) -> str:
    """The described numbers that were wrong."""
    if diagnosis.gap.files and diagnosis.gap.retuned > _WORSE * diagnosis.gap.nominal:
        return "the refitted numbers make the held-out runs worse: keep the described ones"
    if not diagnosis.numbers or diagnosis.verdict == "described":
        which = "every other" if diagnosis.numbers else "every"
        return f"{which} described number is within its tolerance" if diagnosis.rig else "none was refitted"
    return "; ".join(map(wrong_number_in_words, diagnosis.numbers))


def _where(diagnosis: Diagnosis) -> str:
    by_signal: dict[str, float] = {}
    by_regime: dict[tuple[str, str], float] = {}
    for cell in diagnosis.where:
        by_signal[cell.signal] = by_signal.get(cell.signal, 0.0) + cell.share
        key = (cell.signal, cell.regime)
        by_regime[key] = by_regime.get(key, 0.0) + cell.share
    signal, share = max(by_signal.items(), key=lambda item: item[1])
    regimes = sorted(
        ((value, regime) for (signal_of_regime, regime), value in by_regime.items() if signal_of_regime == signal),
        reverse=True,
    )
    shown = ", ".join(f"{percent(value)} at {regime}" for value, regime in regimes[:2] if value > _SMALL_SHARE)
    return f"the gap is mostly in the {signal_name(signal)}, {percent(share)} of it" + (f" ({shown})" if shown else "")
