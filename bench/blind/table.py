"""The scores as text: the answer first, then every score of every method, then the cases that went wrong."""

from typing import NamedTuple

from bench.blind.intervals import Score
from bench.blind.scoring import Scores, Singles

TOOL = "diagnosis"
_CONFUSIONS = 30


class ScoreRow(NamedTuple):
    """One score of every method, with its bar."""

    name: str
    bar: str  # such as ">= 0.85" or "0.85-0.95"; empty for a score without a bar
    scores: tuple[Score | None, ...]  # one a method

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
    every = tuple(methods.values())

    def row(name: str, bar: str, of: list[Score | None]) -> ScoreRow:
        return ScoreRow(name, bar, tuple(of))

    return [
        row("top-1, 2 limits or more", ">= 0.85", [scores.visible.top_1 for scores in every]),
        row("top-3, 2 limits or more", ">= 0.97", [scores.visible.top_3 for scores in every]),
        row("truth in the named group, same", ">= 0.95", [scores.visible.in_group for scores in every]),
        row("mean group size, same", "<= 1.5", [scores.visible.group_size for scores in every]),
        row("top-1, any size", "", [scores.singles.top_1 for scores in every]),
        row("top-3, any size", "", [scores.singles.top_3 for scores in every]),
        row("truth in the named group, same", "", [scores.singles.in_group for scores in every]),
        row("false alarms", "<= 0.05", [scores.false_alarms for scores in every]),
        row("  numbers further off than usual", "", [scores.false_alarms_wide for scores in every]),
        row("outside caught", ">= 0.80", [scores.outside_caught for scores in every]),
        row("  of 2 limits or more", "", [scores.outside_caught_visible for scores in every]),
        row("  outside, but an effect named", "", [scores.outside_named for scores in every]),
        row("sure of a wrong name", "<= 0.05", [scores.sure_of_wrong_name for scores in every]),
        row("sure of any wrong answer", "", [scores.sure_of_wrong_answer for scores in every]),
        row("named, truth not in the group", "", [scores.named_wrong for scores in every]),
        row("two effects: set F1", ">= 0.85", [scores.pair_f1 for scores in every]),
        row("  both named, nothing else", "", [scores.pair_exact for scores in every]),
        row("  one right at least", "", [scores.pair_one_right for scores in every]),
        row("inseparable: truth in group", "", [scores.unclear.in_group for scores in every]),
        row("  two or more of them given", "", [scores.unclear.group_told for scores in every]),
        row("  experiment that would separate", "", [scores.unclear.experiment for scores in every]),
        row("fault in a real log: top-1", "", [scores.real_logs.top_1 for scores in every]),
        row("  truth in the named group", "", [scores.real_logs.in_group for scores in every]),
        row("log score", "", [scores.log_score for scores in every]),
        row("calibration error", "<= 0.05", [scores.calibration_error for scores in every]),
        row("  if every probability were true", "", [scores.calibration_error_of_perfect for scores in every]),
        row("sensor or physics", "", [scores.sensor_or_physics for scores in every]),
        row("localisation F1", "", [scores.locating_f1 for scores in every]),
        row("held-out shrinkage, where named", "", [scores.shrinkage for scores in every]),
        row("  of the oracle's", ">= 0.95", [scores.shrinkage_of_oracle for scores in every]),
        row("  90 % intervals holding it", "0.85-0.95", [scores.interval_coverage for scores in every]),
        row("seconds a case", "", [scores.seconds for scores in every]),
    ]


def table(methods: dict[str, Scores], sealed: bool) -> str:
    """All scores as a text table; the first method is judged by the bars, the others are for comparison."""
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
    for title, part in (
        ("by detectability, in limits", tool.by_detectability),
        ("by friction law, 2 limits or more", tool.by_backbone),
        ("by effect, any size", tool.by_effect),
    ):
        if part:
            lines += ["", f"{title:32}    n  alarm  top-1  top-3  group   size  wrong"]
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
