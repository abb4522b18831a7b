"""A scenario: one rig, one controller, one duration."""

from collections.abc import Sequence
from typing import Any

from pydantic import model_validator

from bridge.config import made_with, validate, with_overrides
from bridge.faults import Fault
from bridge.guard.absent import absent
from bridge.wire import stickslip_pb2 as wire
from cockpit.run.run_tables import RunTables, header_of
from cockpit.run.scenario_file import RIG_FILE, find, is_real_rig, read_scenario, rig_table, with_rig
from cockpit.run.sensor_needs import refuse_blind_sensors, refuse_out_of_travel
from cockpit.run.step import loads_of, with_speeds
from controller.config import seeing, within
from plant.config import RigConfig
from plant.config_limits import refuse_a_spring_of_another_rig, refuse_what_no_rig_does

# Shortest allowed block in real time. With a shorter one the command for a block would arrive after the next block is due.
_SHORTEST_IN_REAL_TIME_S = 1e-3


class Scenario(RunTables):
    """Configuration of one run of a simulated rig. Its validation checks that rig, controller and faults fit together."""

    rig: RigConfig

    @model_validator(mode="after")
    def _fits_together(self) -> "Scenario":
        refuse_what_no_rig_does(self.rig)
        solver, controller = self.rig.solver, self.controller
        for name in ("block_s", "samples_per_block"):
            of_rig, of_controller = getattr(solver, name), getattr(controller, name)
            if of_rig != of_controller:
                raise ValueError(f"controller.{name} = {of_controller}: must equal rig.solver.{name} = {of_rig}")
        refuse_out_of_travel(self.rig, self.duration_s)
        self.refuse_faults_of(absent(self.rig.channels))
        rig = self.rig.model_copy(update={"drive": with_speeds(self.rig.drive, self.step)})
        try:
            controller = within(seeing(controller, absent(self.rig.channels)), self.rig.vibration_limits)
            return self.model_copy(update={"controller": controller, "rig": rig})
        except ValueError as error:
            raise ValueError(f"controller.{error}") from None


class _Runnable(Scenario):
    """A scenario with a given spring, and sensors that show its motion: each started run, not the bench or a replayed log."""

    @model_validator(mode="after")
    def _can_be_judged(self) -> "_Runnable":
        refuse_a_spring_of_another_rig(self.rig)
        refuse_blind_sensors(self.rig, self.controller, self.duration_s)
        return self


def refuse_short_blocks(scenario: Scenario) -> None:
    """Raise Fault CONFIG for blocks that are too short for the bus in real time."""
    block_s = scenario.rig.solver.block_s
    if block_s < _SHORTEST_IN_REAL_TIME_S * (1.0 - 1e-9):
        line = (
            f"{scenario.name}: rig.solver.block_s = {block_s:g}: must be {_SHORTEST_IN_REAL_TIME_S:g} or more in real time, as "
            "each block needs a message to the controller and back; lengthen it, or use --lockstep or --in-process"
        )
        raise Fault("CONFIG", line)


def load_rig(name: str, settings: list[str]) -> RigConfig:
    """A rig by name or path, with `key=value` settings applied. Raises Fault CONFIG."""
    path = find(name, "rigs")
    table = rig_table(path)
    return made_with(lambda given: validate(RigConfig, with_overrides(table, given), path.name), path.name, settings)


def load_scenario(name: str, settings: list[str]) -> Scenario:
    """A scenario by name or path, with `key=value` settings applied. Raises Fault CONFIG.

    Its table `rig` names a rig file (`file`) and may override any of its keys.
    """
    path, given = read_scenario(name)
    if "contact" in given and "rig" not in given:
        raise Fault("CONFIG", f"{path}: is a rig, not a scenario; give it with --rig")

    def table(settings: Sequence[str]) -> tuple[dict[str, Any], str]:
        return with_rig(path, with_overrides(given, settings))

    if is_real_rig(table(settings)[0].get("rig")):
        raise Fault("CONFIG", f"{name}: names a real rig: this command needs a simulated rig; give another --rig")
    of_rig = [setting for setting in settings if setting.startswith(RIG_FILE)]
    _, source = table(settings)
    return made_with(lambda given: validate(_Runnable, *table(given)), source, settings, of_rig)


def header(scenario: Scenario, role: str, lockstep: bool) -> wire.Header:
    """The header of a process of this scenario: role, configuration and versions."""
    more: dict[str, Any] = {}
    if scenario.fault:
        more["fault"] = [table.model_dump(mode="json") for table in scenario.fault]
    if loads := loads_of(scenario.step):
        more["loads"] = loads
    rig = scenario.rig
    return header_of(scenario, rig.model_dump(mode="json"), rig.vibration_limits, rig.name, role, lockstep, more)
