"""The scores as one HTML file that needs no network."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from bench.blind.scoring import Scores
from bench.blind.table import TOOL, headline, rows, table, with_interval
from bridge.files import write_whole
from bridge.pages import filled_page, png
from bridge.provenance import provenance

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 110.0


def write_report(
    methods: dict[str, Scores], by_set: dict[str, Scores], sealed: bool, path: Path, files: Iterable[Path] = ()
) -> None:
    """Write the page, with the hashes of the `files` of the scores at its foot. Raises OSError."""
    tool = methods[TOOL]
    page = filled_page(
        Path(__file__).with_name("report.html.j2"),
        f"Blind score of {', '.join(by_set)}",
        provenance(files).footer(),
        headline=headline(tool, sealed),
        methods=list(methods),
        rows=[row for row in rows(methods) if any(score is not None for score in row.scores)],
        with_interval=with_interval,
        pictures=[
            ("Does 80 % mean 80 %?", png(_reliability(tool), _DPI)),
            ("Wrong answers", png(_confusions(tool), _DPI)),
        ],
        text=table(methods, by_set, sealed),
    )
    write_whole(path, page)


def _reliability(scores: Scores) -> "Figure":
    from matplotlib.figure import Figure

    figure = Figure(figsize=(5.0, 4.2), layout="constrained")
    axis = figure.subplots()
    axis.plot([0, 1], [0, 1], color="#808b96", linewidth=1.0, linestyle=":")
    for group in scores.reliability:
        low, high = group.right.value - group.right.low, group.right.high - group.right.value
        axis.errorbar(
            group.probability,
            group.right.value,
            yerr=[[max(low, 0.0)], [max(high, 0.0)]],
            fmt="o",
            color="#2471a3",
            capsize=3,
        )
        axis.annotate(f" {group.right.n}", (group.probability, group.right.value), fontsize=8)
    axis.set(xlabel="probability of the leading candidate", ylabel="how often it is right", xlim=(0, 1), ylim=(0, 1))
    axis.grid(alpha=0.25)
    return figure


def _confusions(scores: Scores) -> "Figure":
    from matplotlib.figure import Figure

    truths = sorted({name for name, _, _ in scores.confusions})
    answers = sorted({name for _, name, _ in scores.confusions})
    counts = np.zeros((len(truths), len(answers)))
    for truth, answer, count in scores.confusions:
        counts[truths.index(truth), answers.index(answer)] = count
    figure = Figure(figsize=(3.5 + 0.3 * len(answers), 2.5 + 0.25 * len(truths)), layout="constrained")
    axis = figure.subplots()
    if truths:
        axis.imshow(counts, cmap="Blues", vmin=0.0, aspect="auto")
        axis.set_xticks(range(len(answers)), answers, rotation=90, fontsize=7)
        axis.set_yticks(range(len(truths)), truths, fontsize=7)
        for row, column in np.argwhere(counts > 0):
            count = counts[row, column]
            color = "white" if count > 0.6 * counts.max() else "black"  # black on dark blue cannot be read
            axis.text(column, row, f"{count:.0f}", ha="center", va="center", fontsize=7, color=color)
    axis.set(xlabel="answer", ylabel="truth")
    return figure
