"""The scores as text."""

from typing import Any

HEAD = " " * 30 + "    n  alarm  top-1  top-3  group  size  wrong  shrink"


def _rate(value: dict[str, float] | None) -> str:
    return "-" if value is None else f"{value['rate']:.2f}"


def _with_interval(value: dict[str, float] | None) -> str:
    if value is None:
        return "-"
    return f"{value['rate']:.3f} ({value['low']:.3f} to {value['high']:.3f}, n = {value['n']})"


def _number(value: float | None) -> str:
    return "-" if value is None else f"{value:.2f}"


def _row(name: str, scores: dict[str, Any]) -> str:
    n = scores["alarm"]["n"] if scores["alarm"] else 0
    rates = [_rate(scores[key]) for key in ("alarm", "top_1", "top_3", "in_group")]
    return (
        f"{name:30} {n:4} {rates[0]:>6} {rates[1]:>6} {rates[2]:>6} {rates[3]:>6} {_number(scores['group_size']):>5} "
        f"{_rate(scores['wrong']):>6} {_number(scores['shrinkage']):>7}"
    )


def table(scores: dict[str, Any]) -> str:
    """Everything a person wants to see of it."""
    lines = [HEAD, *(_row(name, row) for name, row in scores["effects"].items()), _row("all", scores["all_effects"])]
    for title in ("by_size", "by_detectability"):
        if scores[title]:
            lines += ["", f"{title.replace('_', ' ')}:", *(_row(name, row) for name, row in scores[title].items())]
    everything, none, pairs = scores["all_effects"], scores["no_gap"], scores["pairs"]
    lines += [
        "",
        f"top-1                 {_with_interval(everything['top_1'])}",
        f"in the named group    {_with_interval(everything['in_group'])}",
        f"named and wrong       {_with_interval(everything['wrong'])}",
        f"no gap: false alarms  {_with_interval(none['false_alarms'])}  {dict(none['said'])}",
        f"pairs: set F1         {_number(pairs['set_f1'])}, exact {_with_interval(pairs['exact'])}, "
        f"one right {_with_interval(pairs['one_right'])}",
        f"seconds a case        {_number(scores['seconds'])}",
    ]
    if scores["confusions"]:
        lines += ["", "said instead:"]
        lines += [f"  {n:3} x {there} -> {said}" for there, said, n in scores["confusions"][:40]]
    return "\n".join(lines)
