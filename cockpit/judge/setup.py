"""Numbers of the configurations in the log that the judge needs before the first block."""

import math
from pathlib import Path
from typing import Any, NamedTuple

from bridge.log.metadata import Metadata, configuration_of, is_number, number_of, source_of_import, texts_of

SETTLING_S = 1.0  # settling time after the controller is enabled, stopped or absent


class Setup(NamedTuple):
    """Setup of one run."""

    imported: str  # source file of an imported log; empty for a run
    block_s: float
    enabled_from_s: float  # infinite for an imported log, which has no controller
    slowest_fall_s: float  # of a slip
    absent: list[str]  # channels missing in the source file of an imported log; they are zeros in the log
    known_gain: bool  # of the exciter, by the configuration
    v_ratio: float  # configured set point of v_a / v_d; infinite if unknown
    duration_s: float  # of the whole run, by the plant's configuration; 0: unlimited or unknown

    @property
    def settled_from_s(self) -> float:
        """Start of the judged time."""
        return settled_from_s(self.enabled_from_s)


def settled_from_s(enabled_from_s: float) -> float:
    """Start of the judged time of a controller enabled at `enabled_from_s`."""
    return enabled_from_s + SETTLING_S if enabled_from_s > 0 else 0.0


def is_known(headers: Metadata) -> bool:
    """True if the tables read so far suffice to judge the log."""
    return "import" in headers or "controller" in headers


def setup_of(headers: Metadata, path: Path, period_ns: float) -> Setup:
    """Setup of a log; `period_ns`: block period without a controller. Raises Fault BAD_LOG."""
    absent = absent_channels(headers, path)
    plant = configuration_of(headers, "plant", path) if "plant" in headers else {}
    if source := source_of_import(headers, path):
        return Setup(source, period_ns * 1e-9, math.inf, _slowest_fall_s(plant), absent, True, math.inf, 0.0)
    controller = configuration_of(headers, "controller", path)
    v_ratio = controller.get("limits", {}).get("v_ratio")
    return Setup(
        imported="",
        block_s=number_of(controller, "block_s", path),
        enabled_from_s=number_of(controller, "policy.enabled_from_s", path),
        slowest_fall_s=_slowest_fall_s(plant),
        absent=absent,
        known_gain=bool(controller.get("amplitude", {}).get("known_gain")),
        v_ratio=v_ratio if is_number(v_ratio) else math.inf,
        duration_s=plant["duration_s"] if is_number(plant.get("duration_s")) else 0.0,
    )


def absent_channels(headers: Metadata, path: Path) -> list[str]:
    """Channels missing in the source file of an imported log; they are zeros in the log. Raises Fault BAD_LOG."""
    return texts_of(headers, "import", "missing", path)


def _slowest_fall_s(plant: Any) -> float:
    """Longest duration of a slip: 1.6 times the slip of the plant's slide on its spring, at least 0.1 s."""
    rig = plant.get("rig")
    try:
        return max(0.1, 3.0 * math.sqrt(rig["slide"]["mass_kg"] / rig["drive"]["stiffness_N_per_m"]))
    except (KeyError, TypeError, ValueError, ArithmeticError):  # missing for a foreign rig
        return 0.1
