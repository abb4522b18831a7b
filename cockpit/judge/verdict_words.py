"""The verdict on a run in words."""

import math
from typing import Any

from bridge.log.storage.checksums import checksums_in_words
from bridge.results import strict_json
from bridge.units import counted
from bridge.wire import realtime
from cockpit.judge.machine_terms import Following
from cockpit.judge.pauses import computer_in_words, pauses_in_words
from cockpit.judge.phases import Phase
from cockpit.judge.verdict import NOT_JUDGED, NOT_OK, OK, RunVerdict

_MOST_WARNINGS = 3  # warnings in the short form; more would push its six lines off the screen
_FADE_S = 0.2  # shorter stops are not printed: each run ends with one, while the vibration fades


def in_words(verdict: RunVerdict, verbose: bool, without: Phase | None = None) -> list[str]:
    """The verdict in six lines, or with `verbose` with all figures; `without`: `after`, simulated without the controller."""
    v = verdict
    lines = [headline(v)]
    if v.imported:
        lines.append(f"imported from {v.imported}: {v.untested}")
    else:
        vibrated = v.ratio is not None and v.ratio.judged_s > 0.0
        unsure = "; the exciter's gain was not verified" if v.control == OK and vibrated and not v.gain_verified else ""
        lines.append(f"control  {v.control}{': ' if v.reason else ''}{v.reason}{unsure}")
    lines.append(f"data     {data_in_words(v)}")
    if not v.imported:
        lines.append(computer_in_words(v.computer, v.not_watched))
    if v.before is not None:
        rate = f" ({v.before.slips_per_min:.0f} per minute{'' if v.imported else ' of this phase'})"
        lines.append(f"{'whole' if v.imported else 'before':<8} {_slips(v, v.before, rate)}")
    if v.after is not None:
        lines.append(f"after    {_slips(v, v.after)}")
    if without is not None:
        lines.append(
            f"without  {_slips(v, without)}{_errors(without)}: the stretch after, simulated without the controller"
        )
    if verbose:
        return [*lines, *_figures(v)]
    if begun := [line.removeprefix("INJECTED: ") for line in v.injected if line.startswith("INJECTED: ")]:
        more = f"; and {len(begun) - _MOST_WARNINGS} more: --verbose" if len(begun) > _MOST_WARNINGS else ""
        lines.append(f"injected {'; '.join(begun[:_MOST_WARNINGS])}{more}")
    return [*lines, *shortened([f"warning  {line}" for line in (*v.trips, *v.warnings)], verbose)]


def shortened(lines: list[str], verbose: bool) -> list[str]:
    """The first lines of many, or all with `verbose`."""
    if verbose or len(lines) <= _MOST_WARNINGS:
        return lines
    kind = lines[0].partition(" ")[0]
    return [*lines[:_MOST_WARNINGS], f"{kind:<8} and {len(lines) - _MOST_WARNINGS} more: --verbose"]


def _figures(verdict: RunVerdict) -> list[str]:
    """The lines of the long form after the first six."""
    v = verdict
    lines: list[str] = []
    if v.taking_over is not None and v.taking_over.slips:
        when = f"in the first {v.taking_over.seconds:.1f} s after hand-over (counted neither before nor after)"
        lines.append(f"settling {counted(v.taking_over.slips, 'slip')} {when}")
    lines.extend(_machine_terms(v.before, v.after))
    if v.alone is not None:
        lines.append(f"alone    {_slips(v, v.alone, ' without a controller')}")
    if v.stalled_slips:
        when = "while the rig had no fresh command for a moment, or in the second after"
        lines.append(f"stalled  {counted(v.stalled_slips, 'slip')} {when}")
    if v.stopped_s > _FADE_S:
        slips = f"; {counted(v.stopped_slips, 'slip')} in this time" if v.stopped_slips else ""
        lines.append(
            f"stopped  by an operator, or not armed, for {v.stopped_s:.1f} s (counted neither before nor after){slips}"
        )
    if v.ratio is not None and v.ratio.judged_s:
        lines.append(f"v_a/v_d  {v.ratio.in_words()}; set point at most {v.highest_set_point:.2f}")
        if not v.gain_verified:
            lines.append(
                "exciter  gain not verified: v_a comes from the base accelerometer alone. Run the loop check "
                "(`stickslip arm`) or set amplitude.known_gain."
            )
    if v.latency is not None:
        p50, p99, p999, share, answer_p50, answer_p99 = v.latency
        quantiles = f"p50 {p50:.0f} us, p99 {p99:.0f} us, p99.9 {p999:.0f} us"
        answer = f"; of it the exciter's answer p50 {answer_p50:.0f} us, p99 {answer_p99:.0f} us" if answer_p50 else ""
        lines.append(f"latency  block to command {quantiles}; {100 * share:.2f} % within 1 ms{answer}")
    if v.sample_rate is not None:
        lines.append(f"rate     {v.sample_rate.in_words()}")
    lines.extend(pauses_in_words(v.pauses))
    if v.normal_scheduling:
        who = " and ".join(v.normal_scheduling)
        lines.append(f"priority {who} under {realtime.NORMAL}: {realtime.NOT_GUARANTEED}")
    lines.extend(f"trip     {line}" for line in v.trips)
    lines.extend(f"injected {line}" for line in v.injected)
    lines.extend(f"warning  {line}" for line in v.warnings)
    lines.append(checksums_in_words(v.checksums))
    lines.append(f"log      {v.log}")
    return lines


def strictly(verdict: RunVerdict, strict: bool) -> list[str]:
    """A line with the losses that fail an acceptance test; empty without `strict` or without losses."""
    losses = verdict.losses() if strict and verdict.exit_status(strict=False) != 1 else []
    return [f"strict   not ok: {', '.join(losses)}"] if losses else []


def data_in_words(verdict: RunVerdict) -> str:
    """Completeness of the log, and whether the controller received the missing blocks."""
    v = verdict
    total = v.blocks + v.lost_blocks
    missed = f"the controller missed {'' if v.misses_known else 'at least '}{v.controller_missed}"
    parts = [f"{v.seconds:.2f} of {v.planned_s:.2f} s; the rest is not in the log"] if v.early else []
    if v.lost_blocks:
        had = "the controller had them all" if v.misses_known else "not known whether the controller had them"
        had = missed if v.controller_missed else had
        few = "" if v.all_losses_known else "at least "
        parts.append(f"{few}{v.lost_blocks} of {total} blocks missing in the log{'' if v.imported else f' ({had})'}")
    else:
        if not parts:
            known = v.all_losses_known
            parts = [
                f"whole: {counted(total, 'block')}"
                if known
                else f"{total} blocks; the number of missing blocks is unknown"
            ]
        parts += [missed] if v.controller_missed else []
    others = v.lost_messages - v.lost_blocks
    return "; ".join([*parts, *([f"{counted(others, 'other message')} missing"] if others else [])])


def _machine_terms(before: Phase | None, after: Phase | None) -> list[str]:
    """Following error, reversals and dose under control and before it; empty without a controller."""
    if after is None or after.following is None:
        return []
    was = before.following if before is not None else None
    lines = following_in_words(after.following, was, "before")
    if after.vibration_dose_mm2_per_s > 0.0:
        dose, rms = after.vibration_dose_mm2_per_s, math.sqrt(after.vibration_dose_mm2_per_s / after.seconds)
        lines.append(f"dose     v_a^2 over the {after.seconds:.1f} s of `after`: {dose:.3g} mm2/s, {rms:.2f} mm/s rms")
    return lines


def following_in_words(now: Following, base: Following | None, name: str) -> list[str]:
    """Following error and reversals of a stretch as lines, compared with the stretch `base`, called `name`, if given."""
    lines = [f"error    {_error(now)}"]
    if base is not None:
        lines[0] += f" ({name}: {_um(base.error_rms_m)}, {_um(base.error_peak_m)}, {_um(base.error_ripple_m)})"
    if now.reversals:
        line = f"reversal quadrant error {_worst_reversal(now)}"
        lines.append(line + (f" ({name}: {_worst_reversal(base)})" if base is not None and base.reversals else ""))
    return lines


def _error(of: Following) -> str:
    rms, peak, ripple = _um(of.error_rms_m), _um(of.error_peak_m), _um(of.error_ripple_m)
    return f"following error {rms} um rms, {peak} um peak, {ripple} um rms about its mean"


def _errors(without: Phase) -> str:
    if (following := without.following) is None:
        return ""
    reversal = f", quadrant error {_worst_reversal(following)}" if following.reversals else ""
    return f", {_error(following)}{reversal}"


def _slips(verdict: RunVerdict, phase: Phase, more: str = "") -> str:
    if verdict.blind and not phase.slips:
        return f"slips cannot be judged in {phase.seconds:.1f} s, {_swing(phase)}"
    return f"{counted(phase.slips, 'slip')} in {phase.seconds:.1f} s{more}, {_swing(phase)}"


def _swing(phase: Phase) -> str:
    of = f" (median of {phase.strokes} strokes, without their turns)" if phase.strokes > 1 and not phase.slips else ""
    return f"drive force swings by {phase.swing_N:.2f} N{of}"


def _worst_reversal(following: Following) -> str:
    rests = f"the slide rests for {1e3 * following.reversal_stick_s:.0f} ms"
    return f"{_um(following.quadrant_error_m)} um, {rests}, the worst of {following.reversals}"


def _um(size_m: float) -> str:
    return f"{1e6 * size_m:.3g}" if size_m < 1e-3 else f"{1e6 * size_m:.0f}"


def noted(verdict: RunVerdict) -> dict[str, Any]:
    """Fields of the verdict file of a log."""
    # the log may be renamed, and the file has the other three in fields at its top
    without = "log", "checksums", "good", "headline"
    figures = {name: value for name, value in strict_json(verdict).items() if name not in without}
    return {"good": verdict.good, "headline": headline(verdict), "figures": figures}


def headline(verdict: RunVerdict) -> str:
    """The verdict in one sentence; for a cut log preceded by the time of its end."""
    answer = _answer(verdict)
    return f"{verdict.cut}; {answer}" if verdict.cut and verdict.cut not in answer else answer


def _answer(verdict: RunVerdict) -> str:
    v = verdict
    if v.imported:
        return _imported_answer(v)
    if v.alone is not None:
        slips = f"; {counted(v.alone.slips, 'slip')} without a controller" if v.alone.slips else ""
        return f"{v.reason}{slips}"
    tripped = next((fault for fault in v.faults if fault.startswith("FAULT: ")), None)
    if tripped is not None:
        return f"the rig's guard stopped the vibration: {tripped.removeprefix('FAULT: ')}"
    if v.control == NOT_JUDGED and (v.untested or v.after is None):
        return v.untested
    rest = ""
    if v.stopped_slips:  # they are visible in a figure of the run, so the sentence must explain them
        rest = f"; {counted(v.stopped_slips, 'slip')} while it was stopped or not armed"
    if v.after is not None and v.after.slips > v.unsure_slips and not v.blind:
        return f"stick-slip is still there: {counted(v.after.slips, 'slip')} while the controller was in charge{rest}"
    if v.control != OK:
        blind = f"; slips cannot be judged: {v.blind[0]}" if v.control == NOT_OK and v.blind else ""
        return f"{v.control}: {v.reason.partition('; ')[0]}{blind}{rest}"
    if v.before is not None and v.before.slips_went_on:
        then = v.taking_over.slips if v.taking_over is not None else 0
        over = f"{then} while the controller took over, none after" if then else "none with the controller in charge"
        return f"stick-slip is gone: {counted(v.before.slips, 'slip')} before, {over}{rest}"
    ended = ""
    if v.before is not None and v.before.slips:
        ended = f"; the {counted(v.before.slips, 'slip')} before had ended without it"
    return f"no stick-slip with the controller in charge{ended}{rest}"


def _imported_answer(verdict: RunVerdict) -> str:
    """Answer for measured data of another program."""
    record = verdict.before
    if record is None:
        return f"{verdict.seconds:.1f} s of measured data without a drive force: slips cannot be counted"
    many = counted(record.slips, "slip") if record.slips else "no slip"
    return f"{many} in {record.seconds:.1f} s, {_swing(record)}"
