"""The verdict on a run in words for a mechanic."""

import math
from typing import Any

from bridge.log.in_charge import WEAK_S
from bridge.log.storage.chain import chain_in_words
from bridge.units import counted
from bridge.wire import realtime
from cockpit.judge.machine_terms import Following
from cockpit.judge.pauses import pauses_in_words
from cockpit.judge.phases import Phase
from cockpit.judge.verdict import RunVerdict

VERDICT = "verdict"  # the metadata record of a log that `stickslip run` has judged
_ALARM_RATIO = 1.05
_FADE_S = 0.2  # of the vibration at the end of a run


def in_words(verdict: RunVerdict, without: Phase | None = None) -> list[str]:
    """The verdict as lines for a person, with the stretch after as it is without the controller, if that was simulated."""
    v = verdict
    lines: list[str] = []
    if v.imported:
        lines.append(f"imported from {v.imported}: {v.untested}")
    if v.before is not None:
        rate = f"{v.before.slips_per_min:.0f} per minute{'' if v.imported else ' of this phase'}"
        lines.append(
            f"{'whole ' if v.imported else 'before'}   {counted(v.before.slips, 'slip')} in {v.before.seconds:.1f} s ({rate}), "
            f"{_swing(v.before)}"
        )
    if v.taking_over is not None and v.taking_over.slips:
        lines.append(
            f"settling {counted(v.taking_over.slips, 'slip')} in the {v.taking_over.seconds:.1f} s that the controller has "
            "to take over, which are no part of before or after"
        )
    if v.after is not None:
        lines.append(f"after    {counted(v.after.slips, 'slip')} in {v.after.seconds:.1f} s, {_swing(v.after)}")
    lines.extend(_machine_terms(v.before, v.after))
    if without is not None:
        lines.append(_without_in_words(without))
    if v.alone is not None:
        lines.append(
            f"alone    {counted(v.alone.slips, 'slip')} in {v.alone.seconds:.2f} s with nobody in charge, {_swing(v.alone)}"
        )
    if v.stopped_s > _FADE_S:
        slips = f"; {counted(v.stopped_slips, 'slip')} then" if v.stopped_slips else ""
        lines.append(
            f"stopped  by an operator, or not armed, for {v.stopped_s:.1f} s, which is no part of what came after{slips}"
        )
    if v.velocity_ratio_max > 0:
        low = "ok" if v.velocity_ratio_min >= _ALARM_RATIO else f"below {_ALARM_RATIO}: stick-slip may return"
        lines.append(f"v_a/v_d  {v.velocity_ratio_min:.2f} to {v.velocity_ratio_max:.2f} while vibrating ({low})")
        if not v.gain_verified:
            lines.append(
                "exciter  gain not verified: v_a is what the base accelerometer says; no loop check (`stickslip arm`) confirms "
                "an earlier one, nor is amplitude.known_gain told"
            )
    if v.latency is not None:
        latency = v.latency
        lines.append(
            f"latency  block to command p50 {latency.p50_us:.0f} us, p99 {latency.p99_us:.0f} us, p99.9 "
            f"{latency.p999_us:.0f} us; {100 * latency.within_1_ms:.2f} % within 1 ms"
        )
    lines.extend(pauses_in_words(v.pauses, v.not_watched))
    lost = "none lost" if v.lost_blocks == 0 else f"{v.lost_blocks} LOST"
    if not v.all_losses_known:
        lost = f"at least {lost}" if v.lost_blocks else "how many are lost is not known"
    also = f"; at least {counted(v.lost_messages, 'log message')} lost" if v.lost_messages else ""
    lines.append(f"blocks   {v.blocks}, {lost}{also}")
    if v.normal_scheduling:
        who = " and ".join(v.normal_scheduling)
        lines.append(f"priority {who} under {realtime.NORMAL}: {realtime.NOT_GUARANTEED}")
    lines.extend(f"warning  {fault}" for fault in [*v.faults, *v.told])
    lines.append(chain_in_words(v.chain))
    lines.append(f"log      {v.log}")
    return lines


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
    of_file = "log", "chain"  # these change when the file is moved or written anew
    return {
        "good": verdict.good,
        "headline": headline(verdict),
        "figures": {name: value for name, value in figures.items() if name not in of_file},
    }


def headline(verdict: RunVerdict) -> str:
    """The answer in one line."""
    v = verdict
    if v.imported:
        return _what_is_there(v)
    if v.alone is not None:
        why = ", then it was gone" if v.charge.controller_until_s is not None else ""
        slips = f"; {counted(v.alone.slips, 'slip')} with nobody in charge" if v.alone.slips else ""
        held_s = max(v.seconds - v.enabled_from_s - v.stopped_s - v.alone.seconds, 0.0)
        return f"the controller was in charge for {held_s:.2f} of {v.seconds:.2f} s only{why}{slips}"
    if v.untested or v.after is None:
        return v.untested
    tripped = next((fault for fault in v.faults if fault.startswith("FAULT: ")), None)
    if tripped is not None:
        return f"the rig's guard stopped the vibration: {tripped.removeprefix('FAULT: ')}"
    weak = f"; {', '.join(name for name, seconds in v.charge.reasons_s.items() if seconds > WEAK_S)}"
    weak = weak if len(weak) > 2 else ""
    if v.stopped_slips:  # a picture of the run shows them
        weak += f"; {counted(v.stopped_slips, 'slip')} while it was stopped or not armed"
    if v.after.slips:
        return f"stick-slip is still there: {counted(v.after.slips, 'slip')} while the controller was in charge{weak}"
    untold = next((fault for fault in v.faults if fault.partition(":")[0] not in v.charge.reasons_s), None)
    if untold is not None:  # what is good above the line must not hide why the run is not
        weak += f"; but {untold.partition('; ')[0]}"
    if v.before is not None and v.before.slips:
        then = v.taking_over.slips if v.taking_over is not None else 0
        over = (
            f", {then} while the controller took over, none after" if then else ", none with the controller in charge"
        )
        return f"stick-slip is gone: {counted(v.before.slips, 'slip')} before{over}{weak}"
    return f"no stick-slip with the controller in charge{weak}"


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
