"""The verdict on a run in words."""

import math
from typing import Any

from bridge.log.in_charge import WEAK_S
from bridge.log.storage.chain import chain_in_words
from bridge.units import counted
from bridge.wire import realtime
from cockpit.judge.machine_terms import Following
from cockpit.judge.pauses import computer_in_words, pauses_in_words
from cockpit.judge.phases import Phase
from cockpit.judge.verdict import NOT_JUDGED, NOT_OK, RunVerdict

VERDICT = "verdict"  # the metadata record of a log that `stickslip run` has judged
_MOST_WARNINGS = 3  # in the short form; more would push the six lines off the screen of a run on a busy computer
_FADE_S = 0.2  # of the vibration at the end of a run


def in_words(verdict: RunVerdict, verbose: bool, without: Phase | None = None) -> list[str]:
    """The verdict as lines: the answer in six, and with `verbose` all figures.

    Args:
        verdict: of the run.
        verbose: whether all figures are wanted.
        without: the stretch after as it is without the controller, if that was simulated.

    """
    v = verdict
    lines = [headline(v)]
    if v.imported:
        lines.append(f"imported from {v.imported}: {v.untested}")
    else:
        lines.append(f"control  {v.control}{': ' if v.reason else ''}{v.reason}")
    lines.append(f"data     {data_in_words(v)}")
    if not v.imported:
        lines.append(computer_in_words(v.computer, v.not_watched))
    if v.before is not None:
        rate = f"{v.before.slips_per_min:.0f} per minute{'' if v.imported else ' of this phase'}"
        lines.append(
            f"{'whole ' if v.imported else 'before'}   {counted(v.before.slips, 'slip')} in {v.before.seconds:.1f} s ({rate}), "
            f"{_swing(v.before)}"
        )
    if v.after is not None:
        lines.append(f"after    {counted(v.after.slips, 'slip')} in {v.after.seconds:.1f} s, {_swing(v.after)}")
    if without is not None:
        lines.append(_without_in_words(without))
    if verbose:
        return [*lines, *_figures(v)]
    return [*lines, *shortened([f"warning  {line}" for line in (*v.trips, *v.warnings)], verbose)]


def shortened(lines: list[str], verbose: bool) -> list[str]:
    """The first lines of many, unless all are wanted."""
    if verbose or len(lines) <= _MOST_WARNINGS:
        return lines
    kind = lines[0].partition(" ")[0]
    return [*lines[:_MOST_WARNINGS], f"{kind:<8} and {len(lines) - _MOST_WARNINGS} more: --verbose"]


def _figures(verdict: RunVerdict) -> list[str]:
    """All that the six lines leave out."""
    v = verdict
    lines: list[str] = []
    if v.taking_over is not None and v.taking_over.slips:
        lines.append(
            f"settling {counted(v.taking_over.slips, 'slip')} in the first {v.taking_over.seconds:.1f} s after hand-over "
            "(counted neither before nor after)"
        )
    lines.extend(_machine_terms(v.before, v.after))
    if v.alone is not None:
        lines.append(
            f"alone    {counted(v.alone.slips, 'slip')} in {v.alone.seconds:.2f} s without a controller, {_swing(v.alone)}"
        )
    if v.stalled_slips:
        lines.append(
            f"stalled  {counted(v.stalled_slips, 'slip')} while the rig had no fresh command for a moment, or in the second after"
        )
    if v.stopped_s > _FADE_S:
        slips = f"; {counted(v.stopped_slips, 'slip')} then" if v.stopped_slips else ""
        lines.append(
            f"stopped  by an operator, or not armed, for {v.stopped_s:.1f} s, which is no part of what came after{slips}"
        )
    if v.ratio is not None and v.ratio.judged_s:
        lines.append(f"v_a/v_d  {v.ratio.in_words()}")
        if not v.gain_verified:
            lines.append(
                "exciter  gain not verified: v_a comes from the base accelerometer alone. Run the loop check "
                "(`stickslip arm`) or set amplitude.known_gain."
            )
    if v.latency is not None:
        latency = v.latency
        lines.append(
            f"latency  block to command p50 {latency.p50_us:.0f} us, p99 {latency.p99_us:.0f} us, p99.9 "
            f"{latency.p999_us:.0f} us; {100 * latency.within_1_ms:.2f} % within 1 ms"
        )
    lines.extend(pauses_in_words(v.pauses))
    if v.normal_scheduling:
        who = " and ".join(v.normal_scheduling)
        lines.append(f"priority {who} under {realtime.NORMAL}: {realtime.NOT_GUARANTEED}")
    lines.extend(f"trip     {line}" for line in v.trips)
    lines.extend(f"injected {line}" for line in v.injected)
    lines.extend(f"warning  {line}" for line in v.warnings)
    lines.append(chain_in_words(v.chain))
    lines.append(f"log      {v.log}")
    return lines


def strictly(verdict: RunVerdict, strict: bool) -> list[str]:
    """A line with what an acceptance test does not allow; none where it asks for nothing more, or all is there."""
    losses = verdict.losses() if strict and verdict.exit_status(strict=False) == 0 else []
    return [f"strict   not ok: {', '.join(losses)}"] if losses else []


def data_in_words(verdict: RunVerdict) -> str:
    """What of the run is in the log, and whether the controller had what is not."""
    v = verdict
    total = v.blocks + v.lost_blocks
    if v.lost_blocks:
        had = (
            "the controller had them all" if not v.controller_missed else f"the controller missed {v.controller_missed}"
        )
        few = "" if v.all_losses_known else "at least "
        text = f"{few}{v.lost_blocks} of {total} blocks missing in the log{'' if v.imported else f' ({had})'}"
    elif not v.all_losses_known:
        text = f"{total} blocks; how many are missing is not known"
    else:
        text = f"whole: {counted(total, 'block')}"
        if v.controller_missed:
            text += f"; the controller missed {v.controller_missed}"
    others = v.lost_messages - v.lost_blocks
    return text + (f"; {counted(others, 'other message')} missing" if others else "")


def _machine_terms(before: Phase | None, after: Phase | None) -> list[str]:
    """Following error, reversals and dose with the controller, and before it if it came later; without a controller none."""
    if after is None or after.following is None:
        return []
    was = before.following if before is not None else None
    lines = following_in_words(after.following, was, "before")
    if after.vibration_dose_mm2_per_s > 0.0:
        rms_mm_per_s = math.sqrt(after.vibration_dose_mm2_per_s / after.seconds)
        lines.append(
            f"dose     v_a^2 over the {after.seconds:.1f} s after is {after.vibration_dose_mm2_per_s:.3g} mm2/s, "
            f"{rms_mm_per_s:.2f} mm/s rms"
        )
    return lines


def following_in_words(now: Following, other: Following | None, name: str) -> list[str]:
    """Following error and reversals of a stretch as lines, beside those of another stretch called `name`, if there is one."""
    lines = [
        f"error    following error {_um(now.error_rms_m)} um rms, {_um(now.error_peak_m)} um peak, "
        f"{_um(now.error_ripple_m)} um rms about its mean"
    ]
    if other is not None:
        sizes_m = other.error_rms_m, other.error_peak_m, other.error_ripple_m
        lines[0] += f" ({name}: {', '.join(map(_um, sizes_m))})"
    if now.reversals:
        line = f"reversal quadrant error {_worst_reversal(now)}"
        lines.append(line + (f" ({name}: {_worst_reversal(other)})" if other is not None and other.reversals else ""))
    return lines


def _without_in_words(without: Phase) -> str:
    line = f"without  {counted(without.slips, 'slip')} in {without.seconds:.1f} s, {_swing(without)}"
    if (following := without.following) is not None:
        line += (
            f", following error {_um(following.error_rms_m)} um rms, {_um(following.error_peak_m)} um peak, "
            f"{_um(following.error_ripple_m)} um rms about its mean"
        )
        if following.reversals:
            line += f", quadrant error {_worst_reversal(following)}"
    return f"{line}: the stretch after, simulated without the controller"


def _swing(phase: Phase) -> str:
    of = f" (median of {phase.strokes} strokes, without their turns)" if phase.strokes > 1 else ""
    return f"drive force swings by {phase.swing_N:.2f} N{of}"


def _worst_reversal(following: Following) -> str:
    stands = f"the slide stands for {1e3 * following.reversal_stick_s:.0f} ms"
    return f"{_um(following.quadrant_error_m)} um, {stands}, the worst of {following.reversals}"


def _um(size_m: float) -> str:
    return f"{1e6 * size_m:.3g}" if size_m < 1e-3 else f"{1e6 * size_m:.0f}"


def noted(verdict: RunVerdict) -> dict[str, Any]:
    """The fields of the table `verdict` in a log: what came of the run, as its end was judged."""
    figures = verdict.as_dict()
    apart = "log", "chain", "good", "headline"  # the first two change when the file is moved, or written again
    return {
        "good": verdict.good,
        "headline": headline(verdict),
        "figures": {name: value for name, value in figures.items() if name not in apart},
    }


def headline(verdict: RunVerdict) -> str:
    """The answer in one line."""
    v = verdict
    if v.imported:
        return _what_is_there(v)
    if v.alone is not None:
        slips = f"; {counted(v.alone.slips, 'slip')} without a controller" if v.alone.slips else ""
        return f"{v.reason}{slips}"
    if v.untested or v.after is None:
        return v.untested
    tripped = next((fault for fault in v.faults if fault.startswith("FAULT: ")), None)
    if tripped is not None:
        return f"the rig's guard stopped the vibration: {tripped.removeprefix('FAULT: ')}"
    rest = "".join(f"; {name}" for name, seconds in v.charge.reasons_s.items() if seconds > WEAK_S)
    if v.stopped_slips:  # a picture of the run shows them
        rest += f"; {counted(v.stopped_slips, 'slip')} while it was stopped or not armed"
    if v.after.slips > v.unsure_slips and not v.blind:
        return f"stick-slip is still there: {counted(v.after.slips, 'slip')} while the controller was in charge{rest}"
    if v.control == NOT_OK and v.blind:
        return f"not ok: {v.reason.partition('; ')[0]}; slips cannot be judged: {v.blind[0]}{rest}"
    if v.control == NOT_JUDGED:
        return f"not judged: {v.reason.partition('; ')[0]}{rest}"
    if v.control == NOT_OK and not rest:  # what is good above the line must not hide why the run is not
        rest = f"; but {v.reason.partition('; ')[0]}"
    if v.before is not None and v.before.slips:
        then = v.taking_over.slips if v.taking_over is not None else 0
        over = (
            f", {then} while the controller took over, none after" if then else ", none with the controller in charge"
        )
        return f"stick-slip is gone: {counted(v.before.slips, 'slip')} before{over}{rest}"
    return f"no stick-slip with the controller in charge{rest}"


def _what_is_there(verdict: RunVerdict) -> str:
    """The answer for measured data of another program."""
    whole = verdict.before
    if whole is None:
        return f"{verdict.seconds:.1f} s of measured data without a drive force: slips cannot be counted"
    many = (
        f"{counted(whole.slips, 'slip')} in {whole.seconds:.1f} s"
        if whole.slips
        else f"no slip in {whole.seconds:.1f} s"
    )
    return f"{many}, {_swing(whole)}"
