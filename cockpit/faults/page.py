"""The table of faults as a page: docs/quality/faults.md is made by `make faults`."""

from itertools import groupby

from bridge.units import counted
from cockpit.faults.bench import FaultBench
from cockpit.faults.judge import MOST_RATIO, MOST_S, Outcome

_INTRO = f"""\
# Faults, and what comes of them

<!-- Made by `make faults`; change deploy/faults instead. -->

Each fault of the catalogue in `deploy/faults` begins while the rig vibrates, in simulated time: the loops of plant and
controller run as they are, on a bus and a clock that wait for nobody (`stickslip bench faults`). What happened is read
from the rig itself, not from what the controller measures.

* **safe**: v_a is above {MOST_RATIO:g} times its set point for {MOST_S:g} s at most in all, at zero in time where a stop is due,
  and a word says in time what happened; or no word is needed, and the run is as it is without the fault.
* **SILENT**: bounded, but control, data or protection is lost and no word says what happened.
* **UNSAFE**: more vibration, or a longer one.

The set point is `limits.v_ratio` times the true velocity of the drive. Columns: largest v_a over its set point; time above
{MOST_RATIO:g} times; time until nothing vibrates any more, where it ends; slips after the begin; the first word that says
what, and after how long. How to inject one: [the guide](../guides/inject-faults.md).
"""


def page(result: FaultBench) -> str:
    """The page in Markdown."""
    counts = ", ".join(f"{count} {verdict}" for verdict, count in result.counts.items())
    lines = [_INTRO, f"{counted(len(result.outcomes), 'fault')}: **{counts}**.", ""]
    for group, outcomes in groupby(result.outcomes, key=lambda one: one.group):
        lines += [f"## {group}", "", _HEAD, *map(_row, outcomes), ""]
    return "\n".join(lines)


_HEAD = (
    "| fault | what | peak | above, s | zero after, s | slips | told as | verdict |\n|---|---|---|---|---|---|---|---|"
)


def _row(one: Outcome) -> str:
    told = f"`{one.told_as.word}` {one.told_as.after_s:.2f} s" if one.told_as is not None else ""
    zero = f"{one.zero_after_s:.2f}" if one.zero_after_s is not None else ""
    verdict = f"safe ({one.why})" if one.verdict == "safe" else f"**{one.verdict}**: {one.why}"
    cells = (
        f"`{one.name}`",
        one.about,
        f"{one.peak_ratio:.2f}",
        f"{one.above_s:.2f}",
        zero,
        str(one.slips),
        told,
        verdict,
    )
    return f"| {' | '.join(cells)} |"
