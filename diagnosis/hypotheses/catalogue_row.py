"""The fields of an effect's row in the catalogue, and the texts that several rows share."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, NamedTuple

from diagnosis.hypotheses.scales import Scale, Sizes
from diagnosis.hypotheses.starts import Starts, at_scale


@dataclass(frozen=True)
class Tried:
    """How a form is tried. Parameters without a scale keep their default."""

    scale: Callable[[Sizes], dict[str, Scale]]  # scales of the free parameters on a rig of these sizes
    starts: Starts = at_scale


Over = tuple[str, str]  # a residual, and the variable that it is drawn over: names of `pictures.axes`


class EffectRow(NamedTuple):
    """An effect in the diagnosis."""

    words: str  # meaning on a machine, in plain words
    shown_by: tuple[Over, ...]  # residuals that show the effect, the best first; the next if channels are missing
    forms: dict[str, Tried]
    check: str = ""  # check by hand; empty: the check for the part on which it acts
    check_against: dict[
        str, str
    ] = {}  # check by hand that separates it from another effect; stated in one of the two rows
    shown_twice: bool = (
        False  # whether the first two of `shown_by` are drawn, as its forms show over different variables
    )


BREAKAWAY: Final = "breakaway"
OVER_SPEED: Final = (("friction", "velocity_mps"),)
OF_RATE: Final = (("spring", "extension_rate_mps"), ("curvature", "acceleration_mps2"))
OF_EXTENSION: Final = (("spring", "extension_m"), ("curvature", "acceleration_mps2"))
OF_EXCITER: Final = (("exciter", "frequency_Hz"),)

WEIGHT: Final = "Hang a known weight on the force sensor, and read it empty: its gain and its zero are then known."
ZERO: Final = "Unload the force sensor and read it for ten minutes: a zero that wanders is seen at once."
TAP: Final = (
    "Hold the mass still and tap the drive with a small hammer: a late or smoothed force reading shows against the "
    "accelerometer, damping and compliance of the drive as ringing."
)
FRAME: Final = (
    "Put an accelerometer on the mount of the drive, then on the base, and tap: a part that swings is seen directly."
)
SHAKER: Final = "Put both accelerometers on one calibrated shaker, or turn them over: gravity makes 2 g of difference."
SWEEP: Final = (
    "Sweep the piezo from 0.5 to 5 kHz at rest and look at the base accelerometer: it shows the delivered motion."
)
DRIVE: Final = (
    "Measure the drive position with a second sensor, unloaded: an uneven drive is uneven without the mass, too."
)
TRACK: Final = (
    "Drag along the same track twice, the second time at another speed: an effect of the place returns there."
)
SPEEDS: Final = "Drag at 0.2, 1 and 5 times the present speed, and hold the drive for 1, 10 and 60 s in between."
REVERSE: Final = "Drag to and fro over the same track."
REPEAT: Final = "Repeat one run unchanged after a pause of ten minutes: a drift does not repeat."
