"""The verdict on a run in words for a mechanic."""

from typing import Any

from bridge.log.in_charge import WEAK_S
from bridge.log.storage.chain import chain_in_words
from bridge.units import counted
from bridge.wire import realtime
from cockpit.judge.pauses import pauses_in_words
from cockpit.judge.verdict import RunVerdict

VERDICT = "verdict"  # the metadata record of a log that `stickslip run` has judged
_ALARM_RATIO = 1.05
_FADE_S = 0.2  # of the vibration at the end of a run


def in_words(verdict: RunVerdict) -> list[str]:
    """The verdict as lines for a person."""
    v = verdict
    lines: list[str] = []
    if v.imported:
        lines.append(f"imported from {v.imported}: {v.untested}")
    if v.before is not None:
        rate = f"{v.before.slips_per_min:.0f} per minute{'' if v.imported else ' of this phase'}"
        lines.append(
            f"{'whole ' if v.imported else 'before'}   {counted(v.before.slips, 'slip')} in {v.before.seconds:.1f} s ({rate}), "
            f"drive force swings by {v.before.swing_N:.2f} N"
        )
    if v.taking_over is not None and v.taking_over.slips:
        lines.append(
            f"settling {counted(v.taking_over.slips, 'slip')} in the {v.taking_over.seconds:.1f} s that the controller has "
            "to take over, which are no part of before or after"
        )
    if v.after is not None:
        lines.append(
            f"after    {counted(v.after.slips, 'slip')} in {v.after.seconds:.1f} s, drive force swings by {v.after.swing_N:.2f} N"
        )
    if v.alone is not None:
        lines.append(
            f"alone    {counted(v.alone.slips, 'slip')} in {v.alone.seconds:.2f} s with nobody in charge, drive force swings by "
            f"{v.alone.swing_N:.2f} N"
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
                "exciter  gain not verified: v_a is what the base accelerometer says; neither a loop check (`stickslip arm`) nor "
                "amplitude.known_gain"
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
    return f"{many}, drive force swings by {whole.swing_N:.2f} N"
