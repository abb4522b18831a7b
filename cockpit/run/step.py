"""A table `[[step]]` of a scenario: a change during the run, such as an operator command or another speed of the drive."""

from typing import TYPE_CHECKING, Annotated, Literal

import numpy as np
from pydantic import Field, model_validator

from bridge.config import Strict, validate, with_overrides
from controller.config import ControllerConfig

if TYPE_CHECKING:
    from collections.abc import Sequence

    from plant.drive_config import DriveConfig

_CONTROLLER = "controller."
_FIXED = ("block_s", "samples_per_block")


class StepTable(Strict):
    """One change during a run; exactly one of `command`, `settings`, `speed_mps` and `load`."""

    at_s: Annotated[float, Field(ge=0, le=1e9)] = Field(description="Time of the run.")
    command: Literal["STOP", "RESET", "ARM", "DISARM", "ACCEPT_GAIN"] | None = Field(
        default=None, description="An operator command, for rig and controller."
    )
    settings: list[str] = Field(
        default=[], description="key=value each, of the controller: controller.limits.v_ratio=1.3."
    )
    speed_mps: float | None = Field(
        default=None,
        description="Velocity of the drive from then on; below 0: backwards. Needs a drive with a profile.",
    )
    ramp_s: Annotated[float, Field(gt=0, le=1e6)] = Field(default=0.01, description="Time of the change of speed.")
    load: Annotated[float, Field(gt=0, le=100)] | None = Field(
        default=None, description="Normal load in multiples of the load at the start: both friction forces follow it."
    )

    @model_validator(mode="after")
    def _is_one_change(self) -> "StepTable":
        given = [name for name in ("command", "settings", "speed_mps", "load") if getattr(self, name) not in (None, [])]
        if len(given) != 1:
            keys = " and ".join(given) or "no change"
            raise ValueError(
                f"{keys} given: must be one of command, settings, speed_mps, load; make a [[step]] of each"
            )
        for setting in self.settings:
            if not setting.startswith(_CONTROLLER) or "=" not in setting:
                line = f"settings = {setting}: must be controller.KEY=VALUE, as only the controller can be set in a run"
                raise ValueError(f"{line}; write for example controller.limits.v_ratio=1.3")
        return self

    def after(self, end_s: float) -> str:
        """Its time as text, if it is not before `end_s`; else empty."""
        return f"at_s = {self.at_s:g}" if self.at_s >= end_s else ""

    @property
    def t_ns(self) -> int:
        """Its time in the run."""
        return round(self.at_s * 1e9)


def with_speeds(drive: "DriveConfig", steps: "Sequence[StepTable]") -> "DriveConfig":
    """A drive that changes its speed at the steps. Raises ValueError for a drive without a profile that runs once."""
    points = list(drive.profile)
    for step in sorted(steps, key=lambda step: step.at_s):
        if step.speed_mps is None:
            continue
        if drive.moves or drive.repeat_every_s:
            line = f"step.speed_mps = {step.speed_mps:g}: the drive makes moves or repeats: must run a profile once"
            raise ValueError(f"{line}; change rig.drive.profile or rig.drive.moves instead")
        before_mps = float(np.interp(step.at_s, *np.transpose(points)))
        points = [point for point in points if point[0] < step.at_s]
        points += [(step.at_s, before_mps), (step.at_s + step.ramp_s, step.speed_mps)]
    return drive.model_copy(update={"profile": points})


def loads_of(steps: "Sequence[StepTable]") -> list[tuple[float, float]]:
    """Time [s] and load of each step of the load, in order of time."""
    return sorted((step.at_s, step.load) for step in steps if step.load is not None)


def timed_settings(steps: "Sequence[StepTable]") -> list[str]:
    """The settings of the controller as `key=value@TIMEs`: the form in which a log records them for its replay."""
    return [
        f"{setting.removeprefix(_CONTROLLER)}@{step.at_s!r}s"
        for step in sorted(steps, key=lambda step: step.at_s)
        for setting in step.settings
    ]


def configurations(config: ControllerConfig, steps: "Sequence[StepTable]") -> list[tuple[int, ControllerConfig]]:
    """Time and configuration of the controller after each step that sets it. Raises Fault CONFIG."""
    table, made = config.model_dump(mode="json"), list[tuple[int, ControllerConfig]]()
    for step in sorted(steps, key=lambda step: step.at_s):
        if step.settings:
            table = with_overrides(table, [setting.removeprefix(_CONTROLLER) for setting in step.settings])
            table |= {name: getattr(config, name) for name in _FIXED}
            made.append((step.t_ns, validate(ControllerConfig, table, "step.settings")))
    return made
