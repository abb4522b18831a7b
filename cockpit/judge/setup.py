"""The numbers that the judge needs before the first block, from the configurations in the log."""

import math
from pathlib import Path
from typing import Any, NamedTuple

from bridge.log.metadata import Metadata, configuration_of, is_number, number_of, source_of_import, texts_of

SETTLING_S = 1.0  # time to settle after the controller is enabled, was stopped or was gone


class Setup(NamedTuple):
    """Of one run."""

    imported: str  # the file of another program that the log was made from; empty for a run
    block_s: float
    enabled_from_s: float  # infinite for an imported log, which has no controller
    slowest_fall_s: float  # of a slip
    absent: list[str]  # channels that the file of another program did not hold; they are zeros in its log
    known_gain: bool  # of the exciter, by the configuration
    v_ratio: float  # configured set point of v_a / v_d; infinite where it is not known
    duration_s: float  # of the whole run, by the plant's configuration; 0: without an end, or not known

    @property
    def settled_from_s(self) -> float:
        """Time from which the controller is judged."""
        return settled_from_s(self.enabled_from_s)


def settled_from_s(enabled_from_s: float) -> float:
    """Time from which a controller is judged that is enabled at `enabled_from_s`."""
    return enabled_from_s + SETTLING_S if enabled_from_s > 0 else 0.0


def is_known(headers: Metadata) -> bool:
    """Whether the tables of a log that were read so far suffice to judge it."""
    return "import" in headers or "controller" in headers


def setup_of(headers: Metadata, path: Path, period_ns: float) -> Setup:
    """Of a log; `period_ns` of its blocks counts without a controller. Raises Fault BAD_LOG."""
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
    """Channels that the file of another program did not hold; they are zeros in its log. Raises Fault BAD_LOG."""
    return texts_of(headers, "import", "missing", path)


def _slowest_fall_s(plant: Any) -> float:
    """How long a slip may last: 1.6 times that of the plant's slide on its spring, and never less than 0.1 s."""
    rig = plant.get("rig")
    try:
        return max(0.1, 3.0 * math.sqrt(rig["slide"]["mass_kg"] / rig["drive"]["stiffness_N_per_m"]))
    except (KeyError, TypeError, ValueError, ArithmeticError):  # another rig need not tell
        return 0.1
