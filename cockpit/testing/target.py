"""The rig of a test: the rig of its scenario, or a rig file in its place. Guard and limits belong to the rig."""

from pathlib import Path
from typing import NamedTuple

from bridge.config import with_overrides
from bridge.faults import Fault
from bridge.rig.load import device_of
from cockpit.run.device_run import DeviceRun, is_real, load_device_run
from cockpit.run.run import about_run
from cockpit.run.scenario import Scenario, load_scenario
from cockpit.run.scenario_file import read_scenario, rig_setting
from cockpit.run.simulated.run import DevicesRun, run_with_faults, simulate
from cockpit.testing.lock import RigLock
from cockpit.testing.realtime import run_in_real_time


class Target(NamedTuple):
    """A choice of `stickslip test` and of the plug-in."""

    rig: str = ""  # a rig by name or path, in place of the scenario's; empty: the scenario's
    arm: bool = False  # a real rig may be armed


NO_TARGET = Target()


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
    rig = given.get("rig")
    changes = sorted(set(rig) - {"file"}) if isinstance(rig, dict) and target.rig else []
    if changes:
        line = f"{name}: rig.{changes[0]}: changes the simulated rig: this rig is real"
        raise Fault("NOT_JUDGED", f"{line}; test it without --rig")
    run, folder = load_device_run(name, [*on_target, "arm=false"])
    if run.simulated_only:
        raise Fault("NOT_JUDGED", f"{name}: {run.simulated_only}; test it without --rig")
    return Loaded(run, folder, on_target, target.arm and bool(given.get("arm")))
