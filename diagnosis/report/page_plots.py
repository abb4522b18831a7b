"""The pictures of a diagnosis as PNG inside the page, with a total size that fits into a mail."""

import math
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np

from bridge.pages import png
from diagnosis.result import Picture

if TYPE_CHECKING:
    from matplotlib.figure import Figure

_DPI = 110.0
# Most bytes of base64 for all pictures. Larger: the page exceeds 5 MB and mail servers refuse it. Smaller: coarse pictures.
_ALL_BYTES = 3_500_000
# the bars in page.css have the same colours; line styles differ as well, for readers who do not see the colours
_STYLES: Final[dict[str, dict[str, Any]]] = {
    "measured": {"color": "#1c2833", "linewidth": 1.6},
    "nominal": {"color": "#808b96", "linewidth": 1.2, "linestyle": ":"},
    "retuned": {"color": "#ca6f1e", "linewidth": 1.2, "linestyle": "--"},
    "effect": {"color": "#2471a3", "linewidth": 1.2},
    "points": {"color": "#1c2833", "linestyle": "", "marker": ".", "markersize": 2.5, "alpha": 0.5},
}


class Drawn(NamedTuple):
    """One picture of the page: `png` is base64."""

    title: str
    kind: str
    png: str


def draw(pictures: tuple[Picture, ...]) -> list[Drawn]:
    """Draw every picture, with fewer pixels if their total size would exceed 3.5 MB."""
    dpi = _DPI
    while True:
        drawn = [Drawn(picture.title, picture.kind, png(_figure(picture), dpi)) for picture in pictures]
        size = sum(len(picture.png) for picture in drawn)
        if size <= _ALL_BYTES:
            return drawn
        # The size falls a little slower than the number of pixels, so 0.8 keeps the number of rounds small.
        dpi *= 0.8 * math.sqrt(_ALL_BYTES / size)


def _figure(picture: Picture) -> "Figure":
    from matplotlib.figure import Figure  # noqa: PLC0415

    figure = Figure(figsize=(5.6, 3.1), layout="constrained")
    axis = figure.subplots()
    for curve in picture.curves:
        # matplotlib draws NaN as a hole
        x, y = (np.where(np.isfinite(values), values, np.nan) for values in (curve.x, curve.y))
        axis.plot(x, y, label=_plain(curve.label), **_STYLES[curve.style])
    axis.set_xlabel(_plain(picture.x_label), fontsize=9)
    axis.set_ylabel(_plain(picture.y_label), fontsize=9)
    axis.tick_params(labelsize=8)
    axis.grid(alpha=0.25)
    if picture.kind == "residual":
        axis.axhline(0.0, color="#808b96", linewidth=0.8)
    if any(curve.label for curve in picture.curves):
        # above the curves, as a legend between the curves could hide them
        figure.legend(loc="outside upper left", ncols=3, fontsize=8, frameon=False)
    return figure


def _plain(text: str) -> str:
    """A label as plain text: `$` would begin a formula, and a legend leaves out labels that begin with `_`."""
    return text.replace("$", r"\$").removeprefix("_")
