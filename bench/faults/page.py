"""The table of faults as a page: `make faults` writes runs/faults.md."""

from itertools import groupby

from bench.faults.judge import MOST_RATIO, MOST_S, Outcome
from bench.faults.run import FaultBench
from bridge.units import counted

_INTRO = f"""\
# Faults and their results

Each fault of the catalogue in `deploy/faults` begins while the rig vibrates, in simulated time: the loops of plant and
controller run unchanged, on a simulated bus and clock (`python -m bench faults`). The results are read from the simulated
rig itself, not from the controller's measurements.

* **safe**: v_a is above {MOST_RATIO:g} times its set point for {MOST_S:g} s at most in all, at zero in time where a stop is due,
  and an event or reason reports the fault in time; or no report is needed, and the run equals the run without the fault.
* **SILENT**: bounded, but control, data or protection is lost without a report.
* **UNSAFE**: more or longer vibration than that.

The set point is `limits.v_ratio` times the true velocity of the drive. Columns: largest v_a over its set point; time above
{MOST_RATIO:g} times; slips after the begin; the first report, and its time in the run. How to inject one:
[the guide](../guides/inject-faults.md).
"""


def page(result: FaultBench) -> str:
    """The page in Markdown."""
    counts = ", ".join(f"{count} {verdict}" for verdict, count in result.counts.items())
    lines = [_INTRO, f"{counted(len(result.outcomes), 'fault')}: **{counts}**.", ""]
    for group, outcomes in groupby(result.outcomes, key=lambda outcome: outcome.group):
        lines += [f"## {group}", "", _HEAD, *map(_row, outcomes), ""]
    return "\n".join(lines)


_HEAD = "| fault | description | peak | above, s | slips | report | verdict |\n|---|---|---|---|---|---|---|"


def _row(outcome: Outcome) -> str:
    found = [
        f"`{row.value}` {row.at_s:.2f} s" for row in outcome.expectations if isinstance(row.value, str) and row.at_s
    ]
    verdict = f"safe ({outcome.why})" if outcome.verdict == "safe" else f"**{outcome.verdict}**: {outcome.why}"
    cells = (
        f"`{outcome.name}`",
        outcome.about,
        f"{outcome.peak_ratio:.2f}",
        f"{outcome.above_s:.2f}",
        str(outcome.slips),
        ", ".join(found),
        verdict,
    )
    return f"| {' | '.join(cells)} |"
