"""The answer of a diagnosis in sentences."""

import math

from bridge.units import percent, signal_name, times
from diagnosis.evidence.foreign_vibration import DISTORTED, PICK_UP
from diagnosis.model.per_run import has_own_phases
from diagnosis.report.words import (
    EFFECT_WORDS,
    closed_between,
    closed_in_words,
    estimate_in_words,
    is_undecided,
    latent_answer,
    latent_sentences,
    remainder_in_words,
)
from diagnosis.result import Diagnosis
from diagnosis.verdict.held_out import MORE_THAN_RIGHT

# gap of the baseline over the gap as described from which a refit makes held-out runs worse, not by chance
_WORSE = 1.1
_SMALL_SHARE = 0.05  # smallest share of the gap of a regime that is reported


def summary(diagnosis: Diagnosis) -> tuple[str, ...]:
    """Sentences for the operator, the verdict first and the next experiment last."""
    gap, unexplained = diagnosis.gap, diagnosis.verdict == "unexplained"
    sentences: list[str] = []
    if diagnosis.verdict == "no-gap":
        if is_undecided(diagnosis):
            sentences.append(
                "These runs do not decide: the fitted runs stay within the stated tolerances, but the held-out runs are "
                f"{times(gap.retuned)} noise floors off."
            )
        else:
            sentences.append("No gap beyond the stated tolerances: the rig as described explains these runs.")
        sentences.append(
            "An effect too small to show here is not excluded, and the probabilities leave room for it: in sealed tests more "
            "than a quarter of the rigs without a visible gap had one."
        )
    elif unexplained:
        sentences.append(latent_answer(diagnosis) or "There is a gap, and nothing in the library explains it.")
        if gap.refuted:
            names = " and ".join(gap.refuted)
            with_it = next(row.gap for row in gap.compared if row.who == names)
            explain, it = ("explains", "it") if len(gap.refuted) == 1 else ("explain", "them")
            sentences.append(
                f"{names} {explain} the runs that were fitted, but not {', '.join(gap.files)}, held out: "
                f"there the gap is {times(with_it)} noise floors with {it}, {times(gap.retuned)} for the baseline."
            )
        nearest = next(
            (candidate for candidate in diagnosis.candidates if candidate.effect not in ("none", "unexplained")), None
        )
        if nearest is not None and nearest.form == "random":
            sentences.append(
                f"It scatters as {nearest.effect} at random would (probability {percent(nearest.probability)}), and as bursts "
                "of debris or a tilted track would: these runs do not show its course."
            )
    elif diagnosis.verdict == "partly":
        sentences += [most] if (most := latent_answer(diagnosis)) else []
        sentences.append(
            f"{' and '.join(diagnosis.effects)} explains a part of the difference, more than chance would; the rest is not "
            "explained."
        )
    kept = f" on {', '.join(gap.files)}, held out," if gap.files else ""
    sentences += latent_sentences(diagnosis, kept)
    if diagnosis.remainder is not None and diagnosis.remainder.what:
        sentences.append(f"{remainder_in_words(diagnosis.remainder)}.")
    still = [finding.where.partition(":")[0] for finding in diagnosis.findings if finding.kind == "still"]
    if still:
        sentences.append(f"In {', '.join(still)} the drive does not move: friction and drive are not tested there.")
    vibrating = [finding for finding in diagnosis.findings if finding.kind in (PICK_UP, DISTORTED)]
    for kind in dict.fromkeys(finding.kind for finding in vibrating):
        first, *more = (finding for finding in vibrating if finding.kind == kind)
        others = ", ".join(finding.where.partition(":")[0] for finding in more)
        sentences.append(f"{first.where} {first.text}." + (f" So in {others}." if others else ""))
    if gap.files and math.isfinite(gap.nominal):
        sentences.append(
            f"On {', '.join(gap.files)}, held out, rig and model are {times(gap.nominal)} noise floors apart as described, and "
            f"{times(gap.retuned)} for the baseline, which is refitted inside its tolerances; 1 is a perfect model."
            + (
                " So the gap shows in the fitted runs alone."
                if unexplained and not vibrating and gap.retuned <= 1.0
                else ""
            )
        )
    if gap.files and gap.retuned > _WORSE * gap.nominal:
        sentences.append(
            "The refit makes the held-out runs worse: take the numbers of the description, not the refitted ones."
        )
    if diagnosis.where and diagnosis.verdict != "no-gap":
        sentences.append(_where(diagnosis))
    sure = sum(candidate.probability for candidate in diagnosis.candidates if candidate.effect in diagnosis.effects)
    for i, name in enumerate(diagnosis.effects):
        candidate = next(candidate for candidate in diagnosis.candidates if candidate.effect == name)
        numbers = ", ".join(estimate_in_words(name, *item) for item in candidate.parameters.items())
        says = "explains it" if i == 0 else "is needed besides"
        if diagnosis.verdict == "partly":
            says = "explains a part of it" if i == 0 else "another part"
        elif len(diagnosis.effects) > 1 and i == 0:
            says = f"explains it together with {diagnosis.effects[1]}"
        sentences.append(
            f"{name} {says}"
            + (f" (probability {percent(sure)})" if i == 0 and math.isfinite(sure) else "")
            + f": {EFFECT_WORDS[name]}"
            + (f"; {numbers}." if numbers else ".")
        )
        if candidate.form == "random":
            sentences.append("It varies at random: its scatter is known, its course is not.")
        if has_own_phases(candidate.parameters):
            sentences.append("Its phase differs from run to run, so on a run of unknown phase it counts as scatter.")
    sentences += [f"These runs cannot separate: {', '.join(group)}." for group in diagnosis.not_distinguishable]
    if gap.files and math.isfinite(gap.retuned):
        kept = ", ".join(gap.files)
        if gap.shrinkage is not None and gap.with_effect > gap.retuned:
            sentences.append(
                f"On {kept}, held out, the gap grows from {times(gap.retuned)} to {times(gap.with_effect)} noise floors: "
                "nothing of it is closed there."
            )
        elif gap.shrinkage is not None:
            between = f" (90 %: {known})" if (known := closed_between(gap.interval_90)) else ""
            sentences.append(
                f"On {kept}, held out, the gap falls from {times(gap.retuned)} to {times(gap.with_effect)} noise floors: "
                f"{closed_in_words(gap.shrinkage)} of the part that could be closed{between}."
            )
        elif diagnosis.effects:
            sentences.append(
                f"On {kept}, held out, the baseline leaves no gap to close: new data have not tested the name."
            )
        if diagnosis.effects and gap.with_effect > MORE_THAN_RIGHT:
            sentences.append(
                f"A right explanation leaves about 1 there, not {times(gap.with_effect)}: something else acts as well, if only "
                "a surface rougher than ground steel, or the cause is another one."
            )
    else:
        why = f"In {', '.join(gap.files)}, held out, nothing can be compared" if gap.files else "No run was held out"
        sentences.append(f"{why}: how far the gap closes on new data is not known.")
    if diagnosis.verdict != "no-gap" or diagnosis.next_experiment.gain is not None:
        sentences.append(f"Next: {diagnosis.next_experiment.what}")
    return tuple(sentences)


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
    return f"The gap is mostly in the {signal_name(signal)}, {percent(share)} of it" + (
        f" ({shown})." if shown else "."
    )
