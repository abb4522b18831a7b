"""The rig of a test: the rig of its scenario, or a rig file in its place. Guard and limits belong to the rig."""

from pathlib import Path
from typing import Any, NamedTuple

from bridge.config import with_overrides
from bridge.faults import Fault
from bridge.guard.config import ExciterConfig
from bridge.rig.load import device_of
from cockpit.run.device_run import DeviceRun, is_real, load_device_run
from cockpit.run.run import about_run
from cockpit.run.scenario import Scenario, load_scenario
from cockpit.run.scenario_file import as_settings, read_scenario, rig_setting
from cockpit.run.simulated.run import DevicesRun, run_with_faults, simulate
from cockpit.testing.lock import RigLock
from cockpit.testing.realtime import run_in_real_time


class Target(NamedTuple):
    """A choice of `stickslip test` and of the plug-in."""

    rig: str = ""  # a rig by name or path, in place of the scenario's; empty: the scenario's
    arm: bool = False  # a real rig may be armed


NO_TARGET = Target()
_ENDS = {"sensors.force_lowest_N": "lowest", "sensors.force_range_N": "highest"}  # of the force channel


class Loaded(NamedTuple):
    """A test that can run."""

    run: Scenario | DeviceRun
    folder: Path | None = None  # of the rig file; None: the rig is simulated
    settings: list[str] = []
    arm: bool = False

    def make(self, name: str, log: Path) -> None:
        """Run it and write its log; a real rig is at rest afterwards. Raises Fault."""
        run, folder = self.run, self.folder
        if run.duration_s <= 0.0:
            raise Fault("CONFIG", f"{name}: duration_s = 0: a test must have an end; set duration_s")
        if isinstance(run, Scenario):
            simulate(run, log, about_run(run, lockstep=True))
            return
        with RigLock(run.rig.name):
            device = device_of(run.rig, folder or Path())
            if device.pace == "caller" and not run.rig.exciter.adapter:
                simulated = DevicesRun(run, folder or Path(), self.arm)
                try:
                    run_with_faults(run, log, about_run(run, lockstep=True), run=simulated)
                finally:
                    simulated.close()
            else:
                run_in_real_time(run, name, self.settings, log, self.arm)


def load(name: str, settings: list[str], target: Target) -> Loaded:
    """A test on its target. Raises Fault CONFIG, and NOT_JUDGED if only a simulated rig can carry it out."""
    given = with_overrides(read_scenario(name)[1], settings)
    on_target = [*settings, *([rig_setting(target.rig)] if target.rig else [])]
    if not is_real(name, on_target):
        return Loaded(load_scenario(name, on_target))
    run, folder = load_device_run(name, [*on_target, "arm=false"])
    device = device_of(run.rig, folder)
    is_model = device.pace == "caller"
    rig = given.get("rig")
    changes = (
        {key: value for key, value in rig.items() if key != "file"} if isinstance(rig, dict) and target.rig else {}
    )
    known, unknown = _of_a_model(changes) if is_model else ([], [*changes])
    if unknown:
        line = f"{name}: rig.{unknown[0]}: changes the simulated rig: this rig is real"
        raise Fault("NOT_JUDGED", f"{line}; test it without --rig")
    if known:
        on_target = [*on_target, *known]
        run, folder = load_device_run(name, [*on_target, "arm=false"])
    if refused := run.refused_by(is_model, device.settable):
        raise Fault("NOT_JUDGED", f"{name}: {refused}; test it without --rig")
    return Loaded(run, folder, on_target, target.arm and bool(given.get("arm")))


def _of_a_model(changes: dict[str, Any]) -> tuple[list[str], list[str]]:
    """The settings by which a scenario's changes of a simulated rig hold for a model, and the keys that a model does not have."""
    settings: list[str] = []
    unknown: list[str] = []
    for setting in as_settings(changes):
        key, _, value = setting.partition("=")
        table, _, name = key.partition(".")
        if table in {"channels", "guard"}:
            settings.append(f"rig.{setting}")
        elif table == "piezo" and name in ExciterConfig.model_fields:
            settings.append(f"rig.exciter.{name}={value}")
        elif key in _ENDS:
            settings.append(f"rig.channels.drive_force_N.{_ENDS[key]}={value}")
        else:
            unknown.append(key)
    return settings, unknown
