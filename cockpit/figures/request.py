"""Content and style of a figure, checked before the work."""

import math
from typing import NamedTuple

from bridge.faults import Fault

SCREEN, PAPER = "screen", "paper"
_WIDTH_MM = {SCREEN: 280.0, PAPER: 85.0}  # 85 mm is one column of most journals
_DPI = {SCREEN: 110.0, PAPER: 600.0}
_NARROWEST_MM, _WIDEST_MM = 40.0, 500.0
_COARSEST_DPI, _FINEST_DPI = 50.0, 1200.0


class FigureRequest(NamedTuple):
    """A requested figure; times in seconds of the run, -inf and inf for its ends."""

    from_s: float = -math.inf
    to_s: float = math.inf
    signals: str = ""  # comma-separated; empty: the default signals
    style: str = SCREEN
    width_mm: float = _WIDTH_MM[SCREEN]
    dpi: float = _DPI[SCREEN]

    @property
    def is_window(self) -> bool:
        """True if only part of the run is requested."""
        return math.isfinite(self.from_s) or math.isfinite(self.to_s)


def request_of(
    from_s: float, to_s: float, signals: str, style: str, width_mm: float | None, dpi: float | None
) -> FigureRequest:
    """A checked request; width and resolution default to the style. Raises Fault CONFIG."""
    if from_s >= to_s:
        raise Fault("CONFIG", f"--from {from_s:g} --to {to_s:g}: from must be before to; exchange them")
    if style not in _WIDTH_MM:
        raise Fault("CONFIG", f"--style {style}: must be {SCREEN} or {PAPER}; choose one of these")
    width_mm, dpi = width_mm or _WIDTH_MM[style], dpi or _DPI[style]
    if not _NARROWEST_MM <= width_mm <= _WIDEST_MM:
        line = f"--width {width_mm:g}: must be from {_NARROWEST_MM:g} to {_WIDEST_MM:g} mm"
        raise Fault("CONFIG", f"{line}; a column of a journal is about {_WIDTH_MM[PAPER]:g}")
    if not _COARSEST_DPI <= dpi <= _FINEST_DPI:
        line = f"--dpi {dpi:g}: must be from {_COARSEST_DPI:g} to {_FINEST_DPI:g}"
        raise Fault("CONFIG", f"{line}; journals ask for 300 to 600, and .svg and .pdf need none")
    return FigureRequest(from_s, to_s, signals, style, width_mm, dpi)
