"""What the judge needs to know of a run before it can judge a block of it: from the configurations in its log."""

import math
from pathlib import Path
from typing import Any, NamedTuple

from bridge.log.metadata import Metadata, configuration_of, is_number, number_of, source_of_import, texts_of

SETTLING_S = 1.0  # after the controller is enabled, was stopped or was not there, it has this long


class Setup(NamedTuple):
    """Of one run."""

    imported: str  # the file of another program that the log was made from; empty for a run
    block_s: float
    enabled_from_s: float  # infinite for an imported log, which has no controller
    slowest_fall_s: float  # of a slip
    absent: list[str]  # channels that the file of another program did not hold; they are zeros in its log
    known_gain: bool  # of the exciter, by the configuration
    duration_s: float  # of the whole run, by the plant's configuration; 0: it has no end, or another rig does not tell

    @property
    def settled_from_s(self) -> float:
        """From when on the controller is judged."""
        return settled_from_s(self.enabled_from_s)


def settled_from_s(enabled_from_s: float) -> float:
    """From when on a controller that is enabled then is judged."""
    return enabled_from_s + SETTLING_S if enabled_from_s > 0 else 0.0


def is_known(headers: Metadata) -> bool:
    """Whether the tables of a log that were read so far tell how to judge it."""
    return "import" in headers or "controller" in headers


def setup_of(headers: Metadata, path: Path, period_ns: float) -> Setup:
    """Of a log; `period_ns` of its blocks counts where no controller tells it. Raises Fault BAD_LOG."""
    absent = absent_channels(headers, path)
    plant = configuration_of(headers, "plant", path) if "plant" in headers else {}
    if source := source_of_import(headers, path):
        return Setup(source, period_ns * 1e-9, math.inf, _slowest_fall_s(plant), absent, True, 0.0)
    controller = configuration_of(headers, "controller", path)
    return Setup(
        imported="",
        block_s=number_of(controller, "block_s", path),
        enabled_from_s=number_of(controller, "policy.enabled_from_s", path),
        slowest_fall_s=_slowest_fall_s(plant),
        absent=absent,
        known_gain=bool(controller.get("amplitude", {}).get("known_gain")),
        duration_s=plant["duration_s"] if is_number(plant.get("duration_s")) else 0.0,
    )


def absent_channels(headers: Metadata, path: Path) -> list[str]:
    """Channels that the file of another program did not hold; they are zeros in its log. Raises Fault BAD_LOG."""
    return texts_of(headers, "import", "missing", path)


def _slowest_fall_s(plant: Any) -> float:
    """How long a slip may last: 1.6 times that of the plant's slide on its spring, and never less than 0.1 s."""
    rig = plant.get("rig")
    try:
        return max(0.1, 3.0 * math.sqrt(rig["slide"]["mass_kg"] / rig["drive"]["stiffness_N_per_m"]))
    except (KeyError, TypeError, ValueError, ArithmeticError):  # another rig need not tell
        return 0.1
