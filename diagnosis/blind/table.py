"""The scores as text: the answer first, then every score of every method, then the cases that went wrong."""

from typing import NamedTuple

from diagnosis.blind.intervals import Score
from diagnosis.blind.scoring import Scores, Singles

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
        row("top-1, 2 limits or more", ">= 0.85", [one.visible.top_1 for one in every]),
        row("top-3, 2 limits or more", ">= 0.97", [one.visible.top_3 for one in every]),
        row("truth in the named group, same", ">= 0.95", [one.visible.in_group for one in every]),
        row("mean group size, same", "<= 1.5", [one.visible.group_size for one in every]),
        row("top-1, any size", "", [one.singles.top_1 for one in every]),
        row("top-3, any size", "", [one.singles.top_3 for one in every]),
        row("truth in the named group, same", "", [one.singles.in_group for one in every]),
        row("false alarms", "<= 0.05", [one.false_alarms for one in every]),
        row("  numbers further off than usual", "", [one.false_alarms_wide for one in every]),
        row("outside caught", ">= 0.80", [one.outside_caught for one in every]),
        row("  of 2 limits or more", "", [one.outside_caught_visible for one in every]),
        row("  outside, but an effect named", "", [one.outside_named for one in every]),
        row("sure of a wrong name", "<= 0.05", [one.sure_of_wrong_name for one in every]),
        row("sure of any wrong answer", "", [one.sure_of_wrong_answer for one in every]),
        row("named, truth not in the group", "", [one.named_wrong for one in every]),
        row("two effects: set F1", ">= 0.85", [one.pair_f1 for one in every]),
        row("  both named, nothing else", "", [one.pair_exact for one in every]),
        row("  one right at least", "", [one.pair_one_right for one in every]),
        row("cannot be told: truth in group", "", [one.unclear.in_group for one in every]),
        row("  two or more of them given", "", [one.unclear.group_told for one in every]),
        row("  experiment that would tell", "", [one.unclear.experiment for one in every]),
        row("fault in a real log: top-1", "", [one.real_logs.top_1 for one in every]),
        row("  truth in the named group", "", [one.real_logs.in_group for one in every]),
        row("log score", "", [one.log_score for one in every]),
        row("calibration error", "<= 0.05", [one.calibration_error for one in every]),
        row("  if every probability were true", "", [one.calibration_error_of_perfect for one in every]),
        row("sensor or physics", "", [one.sensor_or_physics for one in every]),
        row("localisation F1", "", [one.locating_f1 for one in every]),
        row("held-out shrinkage, where named", "", [one.shrinkage for one in every]),
        row("  of the oracle's", ">= 0.95", [one.shrinkage_of_oracle for one in every]),
        row("  90 % intervals holding it", "0.85-0.95", [one.interval_coverage for one in every]),
        row("seconds a case", "", [one.seconds for one in every]),
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
        if any(one is not None for one in row.scores):
            cells = "".join(f" {_value(one):>12}" for one in row.scores[1:])
            said = with_interval(row.scores[0]) + (" missed" if row.missed else "")
            lines.append(f"{row.name:32} {row.bar:>9}  {said:33}{cells}".rstrip())
    for title, part in (
        ("by detectability, in limits", tool.by_detectability),
        ("by friction law, 2 limits or more", tool.by_backbone),
        ("by effect, any size", tool.by_effect),
    ):
        if part:
            lines += ["", f"{title:32}    n  alarm  top-1  top-3  group   size  wrong"]
            lines += [_line(name, singles) for name, singles in part.items()]
    if tool.confusions:
        lines += ["", "said instead:"]
        lines += [f"  {count:3} x {there} -> {said}" for there, said, count in tool.confusions[:_CONFUSIONS]]
    return "\n".join(lines)


def with_interval(score: Score | None) -> str:
    """A score with its interval and its number of cases, as text."""
    return "-" if score is None else f"{score.value:.2f} ({score.low:.2f} to {score.high:.2f}) n {score.n}"


def _line(name: str, singles: Singles) -> str:
    n = singles.alarm.n if singles.alarm else 0
    parts = (singles.alarm, singles.top_1, singles.top_3, singles.in_group, singles.group_size, singles.wrong)
    return f"{name:32} {n:4}" + "".join(f" {_value(one):>6}" for one in parts)


def _value(score: Score | None) -> str:
    return "-" if score is None else f"{score.value:.2f}"


def _percent(score: Score | None) -> str:
    if score is None:
        return "-"
    return f"{100 * score.value:.0f} % ({100 * score.low:.0f} to {100 * score.high:.0f})"
