"""The scores as text: the answer first, then every score of every method, then the cases that went wrong."""

from collections.abc import Callable
from typing import NamedTuple

from bench.blind.intervals import Score
from bench.blind.scoring import Scores, Singles

TOOL = "diagnosis"
_CONFUSIONS = 30  # most wrong answers in the table


class ScoreRow(NamedTuple):
    """One score of every method, with its bar."""

    name: str
    bar: str  # limits of the score, such as ">= 0.85" or "0.85-0.95"; empty without a bar
    scores: tuple[Score | None, ...]  # one score for each method

    @property
    def missed(self) -> bool:
        """Whether the first method misses the bar; the value is compared before rounding."""
        first = self.scores[0]
        if not self.bar or first is None:
            return False
        sign, _, bound = self.bar.rpartition(" ")
        if sign:
            return first.value < float(bound) if sign == ">=" else first.value > float(bound)
        low, high = map(float, bound.split("-"))
        return not low <= first.value <= high


_SCORES: tuple[tuple[str, str, Callable[[Scores], Score | None]], ...] = (  # name, bar and score of each row
    ("first, 2 limits or more", ">= 0.92", lambda scores: scores.visible.top_1),
    ("in three, 2 limits or more", ">= 0.97", lambda scores: scores.visible.top_3),
    ("truth in group, 2 limits or more", ">= 0.95", lambda scores: scores.visible.in_group),
    ("group size, 2 limits or more", "<= 1.4", lambda scores: scores.visible.group_size),
    ("first, any size", "", lambda scores: scores.singles.top_1),
    ("in three, any size", "", lambda scores: scores.singles.top_3),
    ("two effects: set F1", ">= 0.80", lambda scores: scores.pair_f1),
    ("outside recognised", ">= 0.80", lambda scores: scores.outside_caught),
    ("wrong number named", "", lambda scores: scores.number_named),
    ("  its value within 2 %", ">= 0.85", lambda scores: scores.number_right),
    ("false alarms", "<= 0.05", lambda scores: scores.false_alarms),
    ("sure of a wrong name", "<= 0.019", lambda scores: scores.sure_of_wrong_name),
    ("calibration error", "<= 0.06", lambda scores: scores.calibration_error),
    ("  if every probability were true", "", lambda scores: scores.calibration_error_of_perfect),
    ("where, F1", ">= 0.70", lambda scores: scores.locating_f1),
    ("held-out shrinkage, where named", "", lambda scores: scores.shrinkage),
    ("  of the oracle's", ">= 0.95", lambda scores: scores.shrinkage_of_oracle),
    ("  90 % intervals holding it", "0.83-0.97", lambda scores: scores.interval_coverage),
    ("CPU seconds a case, median", "<= 20", lambda scores: scores.cpu_median_s),
    ("  95 %", "<= 45", lambda scores: scores.cpu_95_s),
)


def headline(scores: Scores, sealed: bool) -> str:
    """The answer in one sentence."""
    kind = (
        "sealed set, opened once"
        if sealed
        else "DEVELOPMENT DATA: the answers could be known before these results were made"
    )
    return (
        f"{scores.cases} cases ({kind}): right effect first in {_percent(scores.visible.top_1)} of the visible single "
        f"effects, false alarms {_percent(scores.false_alarms)}, sure of a wrong name {_percent(scores.sure_of_wrong_name)}"
    )


def rows(methods: dict[str, Scores]) -> list[ScoreRow]:
    """All scores, one row each."""
    return [ScoreRow(name, bar, tuple(score(scores) for scores in methods.values())) for name, bar, score in _SCORES]


def table(methods: dict[str, Scores], by_set: dict[str, Scores], sealed: bool) -> str:
    """All scores as a text table, of all sets and then of each; the first method is judged by the bars."""
    tool = next(iter(methods.values()))
    lines = [headline(tool, sealed)]
    if tool.faults:
        lines.append(f"{tool.faults} cases ended in a fault and count as wrong")
    others = list(methods)[1:]
    lines += ["", f"{'':32} {'bar':>9}  {TOOL:33}" + "".join(f" {name:>12}" for name in others)]
    for row in rows(methods):
        if any(score is not None for score in row.scores):
            cells = "".join(f" {_value(score):>12}" for score in row.scores[1:])
            value = with_interval(row.scores[0]) + (" missed" if row.missed else "")
            lines.append(f"{row.name:32} {row.bar:>9}  {value:33}{cells}".rstrip())
    if len(by_set) > 1:
        lines += ["", f"{f'{TOOL}, by set':32}" + "".join(f" {name:>20.20}" for name in by_set)]
        for row in rows(by_set):
            if any(score is not None for score in row.scores):
                cells = ("-" if score is None else f"{score.value:.2f} of {score.n}" for score in row.scores)
                lines.append(f"{row.name:32}" + "".join(f" {cell:>20}" for cell in cells))
    for title, part in (
        ("by detectability, in limits", tool.by_detectability),
        ("by friction law, 2 limits or more", tool.by_backbone),
        ("by effect, any size", tool.by_effect),
    ):
        if part:
            lines += ["", f"{title:32}    n  alarm  first  three  group   size  wrong"]
            lines += [_line(name, singles) for name, singles in part.items()]
    if tool.confusions:
        lines += ["", "wrong answers (truth -> answer):"]
        lines += [f"  {count:3} x {truth} -> {value}" for truth, value, count in tool.confusions[:_CONFUSIONS]]
    return "\n".join(lines)


def with_interval(score: Score | None) -> str:
    """A score with its interval and its number of cases, as text."""
    return "-" if score is None else f"{score.value:.2f} ({score.low:.2f} to {score.high:.2f}) n {score.n}"


def _line(name: str, singles: Singles) -> str:
    n = singles.alarm.n if singles.alarm else 0
    parts = (singles.alarm, singles.top_1, singles.top_3, singles.in_group, singles.group_size, singles.wrong)
    return f"{name:32} {n:4}" + "".join(f" {_value(score):>6}" for score in parts)


def _value(score: Score | None) -> str:
    return "-" if score is None else f"{score.value:.2f}"


def _percent(score: Score | None) -> str:
    if score is None:
        return "-"
    return f"{100 * score.value:.0f} % ({100 * score.low:.0f} to {100 * score.high:.0f})"
