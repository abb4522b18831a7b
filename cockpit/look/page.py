"""A look as one offline page, with pictures: the force with its slips, overlaid cycles, histograms, friction over speed."""

import io
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np

from bridge.files import write_whole
from bridge.pages import filled_page
from bridge.provenance import provenance
from cockpit.look.pieces import Looked
from diagnosis.look.look import LookResult
from diagnosis.look.words import TITLES, headline, limits_of_look, meaning_of, symbol_of, with_interval

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_INK, _RED, _BLUE, _PALE = "#1f2d3a", "#b5402a", "#2a6fb5", "#9fb3c8"
_COLUMNS = 2000  # columns to which a long curve is reduced, each with its smallest and largest value; a screen has fewer pixels
_MOST_LAID = 200  # most cycles that are overlaid


def pictures(seen: LookResult) -> list[tuple[str, str, "Figure"]]:
    """Title, caption and figure of each picture for the record."""
    caption = "The whole record: breakaways red, re-sticks blue. Long records are drawn as envelopes."
    figures = [("The force", caption, whole(seen))]
    if seen.sticks and len(seen.cycles) > 1:
        figures.append(("Overlaid cycles", "Each stick and slip; time counts from its breakaway.", laid_over(seen)))
        figures.append(("Slips", "Distribution of the breakaway forces and the stick times.", histograms(seen)))
    if seen.at_speeds:
        caption = "Mean force and breakaway force at each drive speed, with 90 % intervals."
        figures.append(("Friction over speed", caption, over_speed(seen)))
    return figures


def whole(seen: LookResult, size_in: tuple[float, float] = (9.0, 3.2)) -> "Figure":
    """Force over time with its slips."""
    figure, axes = _figure(size_in)
    for part in seen.parts:
        _draw(axes, part.t_s, part.sign * part.force_N)
    if seen.sticks:
        sign = np.array([cycle.sign for cycle in seen.cycles])
        tops = np.array([(cycle.breakaway_t_s, cycle.breakaway_force_N) for cycle in seen.cycles])
        ends = np.array([(cycle.restick_t_s, cycle.restick_force_N) for cycle in seen.cycles])
        axes.plot(tops[:, 0], sign * tops[:, 1], "v", color=_RED, markersize=4, label="breakaway")
        axes.plot(ends[:, 0], sign * ends[:, 1], "^", color=_BLUE, markersize=4, label="re-stick")
        axes.legend(loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, ncols=2)  # above the curve
    axes.set_xlabel("time [s]")
    axes.set_ylabel(_force(seen, "force"))
    return figure


def laid_over(seen: LookResult) -> "Figure":
    """Overlaid cycles: each stick and slip, and the force after the slip for as long as the slip lasted."""
    figure, axes = _figure((9.0, 3.2))
    cycles = seen.cycles[:: max(len(seen.cycles) // _MOST_LAID, 1)]
    for cycle in cycles:
        part = next((piece for piece in seen.parts if piece.t_s[0] <= cycle.breakaway_t_s <= piece.t_s[-1]), None)
        if part is None or not np.isfinite(cycle.dwell_s) or not np.isfinite(cycle.restick_t_s):
            continue
        slip_s = cycle.restick_t_s - cycle.breakaway_t_s
        ends_s = cycle.breakaway_t_s - cycle.dwell_s, cycle.restick_t_s + slip_s
        span = slice(*np.searchsorted(part.t_s, ends_s).tolist())
        _draw(axes, part.t_s[span] - cycle.breakaway_t_s, part.force_N[span], alpha=max(0.08, 1.0 / len(cycles) ** 0.5))
    axes.set_xlabel("time from breakaway [s]")
    axes.set_ylabel(_force(seen, "force along the motion"))
    return figure


def histograms(seen: LookResult) -> "Figure":
    """Breakaway forces and stick times."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(9.0, 2.8), layout="constrained")
    left, right = figure.subplots(1, 2)
    tops = [cycle.breakaway_force_N for cycle in seen.cycles]
    dwells = [cycle.dwell_s for cycle in seen.cycles if np.isfinite(cycle.dwell_s)]
    of_tops = _force(seen, "force at breakaway", "coefficient at breakaway")
    for axes, column, label in ((left, tops, of_tops), (right, dwells, "stick time [s]")):
        values = np.array(column)
        mean, middle = float(values.mean()), 0.5 * float(values.min() + values.max())
        half = max(0.501 * float(np.ptp(values)), 0.01 * abs(mean))  # equal values need bins of a readable width
        bins = min(max(int(len(values) ** 0.5) + 1, 5), 40)
        axes.hist(values, bins=bins, range=(middle - half, middle + half), color=_PALE, edgecolor="white")
        axes.axvline(mean, color=_RED, linewidth=1.2)
        axes.set_xlabel(label)
        axes.set_ylabel("slips")
        axes.yaxis.get_major_locator().set_params(integer=True)
        axes.locator_params(axis="x", nbins=4)  # nearly equal values have labels of many digits
        _plain(axes)
    return figure


def over_speed(seen: LookResult) -> "Figure":
    """Friction at each speed; as a coefficient if the load is known."""
    figure, axes = _figure((9.0, 3.2))
    load = seen.known.load_N
    scale = 1.0 / load if load else 1.0
    speeds = [1e3 * point.speed_mps for point in seen.at_speeds]
    for label, color, numbers in (
        ("mean", _INK, [point.mean_N for point in seen.at_speeds]),
        ("breakaway", _RED, [point.breakaway_N for point in seen.at_speeds]),
    ):
        rows = [(v, number) for v, number in zip(speeds, numbers, strict=True) if number is not None]
        if not rows:
            continue
        values = np.array([number.value for _, number in rows])
        errors = np.nan_to_num(np.array([number.high - number.value for _, number in rows]))
        axes.errorbar(
            [v for v, _ in rows], scale * values, scale * errors, fmt="o-", color=color, capsize=3, label=label
        )
    axes.set_xscale("log")
    axes.set_xlabel(f"speed of the drive [m{seen.known.speed_unit}]")
    axes.set_ylabel("friction coefficient" if load else _force(seen, "force"))
    axes.legend(frameon=False)
    return figure


def save(figure: "Figure", file: IO[bytes], kind: str, note: str) -> None:
    """Write a figure; `kind` is svg, pdf or png, and `note` is written at its foot and in its metadata."""
    from matplotlib import rc_context

    metadata = {"Title": note} if kind in ("svg", "pdf") else {"Description": note}
    figure.text(0.005, 0.005, note, fontsize=4.5, color="#808b96", va="bottom")
    figure.get_layout_engine().set(rect=(0.0, 0.03, 1.0, 0.97))  # type: ignore[union-attr]
    with rc_context({"svg.fonttype": "none", "pdf.fonttype": 42}):
        figure.savefig(file, dpi=200, format=kind, metadata=metadata | ({"Date": None} if kind == "svg" else {}))


def as_svg(figure: "Figure") -> str:
    """A figure as SVG for a page, with a transparent background."""
    from matplotlib import rc_context

    file = io.StringIO()
    with rc_context({"svg.fonttype": "none"}):
        figure.savefig(file, format="svg", metadata={"Date": None}, transparent=True)
    text = file.getvalue()
    return text[text.index("<svg") :]


def _figure(size_in: tuple[float, float]) -> tuple["Figure", Any]:
    from matplotlib.figure import Figure

    figure = Figure(figsize=size_in, layout="constrained")
    axes = figure.subplots()
    _plain(axes)
    return figure, axes


def _force(seen: LookResult, force: str, coefficient: str = "friction coefficient") -> str:
    """The label of an axis of forces or of coefficients."""
    return coefficient if seen.known.coefficient else f"{force} [{seen.known.force_unit}]"


def _plain(axes: Any) -> None:
    axes.spines[["top", "right"]].set_visible(False)


def _draw(axes: Any, x: Any, y: Any, alpha: float = 1.0) -> None:
    """Draw a line; for many samples their envelope, which keeps every slip."""
    if len(x) > 4 * _COLUMNS:
        width = len(x) // _COLUMNS
        whole_columns = len(x) // width * width
        rows = y[:whole_columns].reshape(-1, width)
        middle = x[:whole_columns].reshape(-1, width)
        x = np.column_stack([middle[:, 0], middle[:, width // 2]]).ravel()
        y = np.column_stack([rows.min(axis=1), rows.max(axis=1)]).ravel()
    axes.plot(x, y, color=_INK, linewidth=0.8, alpha=alpha)
    axes.margins(x=0.01)


def write_page(result: Looked, source: Path, out: Path) -> None:
    """Write the offline page: numbers and pictures of a record, its pieces, and findings on its reading. Raises OSError."""
    seen = result.seen
    answer = headline(seen)
    text = filled_page(
        Path(__file__).with_name("page.html.j2"),
        f"{source.name}: {answer}",
        name=source.name,
        headline=answer,
        rows=[
            (symbol_of(name, seen), with_interval(seen.numbers[name]), meaning_of(name, seen))
            for name in TITLES
            if name in seen.numbers
        ],
        open=limits_of_look(seen),
        figures=[(title, caption, as_svg(figure)) for title, caption, figure in pictures(seen)],
        findings=result.findings,
        provenance=provenance([source]).in_words(),
        seen=seen,
        result=result,
        unit="" if seen.known.coefficient else seen.known.force_unit,
        with_interval=with_interval,
    )
    write_whole(out, text)
