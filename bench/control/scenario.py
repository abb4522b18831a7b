"""The scenarios of the bank: families, each one scenario file of bench/control/scenarios with `[[sweep]]`, and a table `bank`."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from bridge.config import Strict, read_toml, validate, with_overrides
from bridge.faults import Fault
from cockpit.run.scenario import Scenario
from cockpit.run.scenario_file import cases_of, merged, with_rig
from plant.config import RigConfig

NotNegative = Annotated[float, Field(ge=0)]
_AT_REST_MPS = 1e-5  # in place of the slowest feed of a drive that rests
Expect = Literal["helped", "not-needed", "blind", "cannot-help"]


class HumConfig(Strict):
    """A sine on the force and on both positions."""

    frequency_Hz: Annotated[float, Field(gt=0)] = 50.0
    force_N: NotNegative = 0.0
    position_m: NotNegative = 0.0


class AssumedConfig(Strict):
    """The controller's settings of the rig, as ratios to the true values."""

    drive_stiffness_ratio: Annotated[float, Field(gt=0)] = 1.0
    drive_stiffness_given: bool = Field(default=True, description="false: its file gives no drive_stiffness_N_per_m.")


class BankConfig(Strict):
    """The keys of the bank, in addition to the tables of a scenario."""

    expect: Expect = "helped"
    small: bool = Field(default=False, description="Part of the small bank, which `make test` runs.")
    hum: HumConfig = HumConfig()
    told: AssumedConfig = AssumedConfig()


class BankScenario(NamedTuple):
    """One scenario of the bank."""

    family: str
    name: str
    description: str
    bank: BankConfig
    rig: RigConfig
    table: dict[str, Any]  # tables of the whole scenario, with the controller's settings
    source: str

    @property
    def duration_s(self) -> float:
        """Duration of the run."""
        return float(self.table.get("duration_s", 16.0))

    @property
    def seed(self) -> int:
        """Seed of the sensor noise."""
        return int(self.table.get("seed", 1))

    @property
    def enabled_from_s(self) -> float:
        """Time from which the controller may vibrate."""
        return float(self.table["controller"].get("policy", {}).get("enabled_from_s", 0.0))

    @property
    def ever_enabled(self) -> bool:
        """Whether vibration is allowed at any time of the run; without it rivals are not run."""
        return self.enabled_from_s < self.duration_s

    @property
    def slowest_mps(self) -> float:
        """The slowest feed of the run; for a resting drive 1e-5 m/s, which a sensor shows at once."""
        return min(self.rig.drive.speeds_mps(), default=_AT_REST_MPS)

    def scenario(self) -> Scenario:
        """The scenario as the controller gets it. Raises Fault CONFIG where the controller refuses it."""
        return validate(Scenario, self.table, self.source)


def load_bank(folder: Path | None = None) -> list[BankScenario]:
    """All scenarios of the bank, family by family in the order of the names. Raises Fault CONFIG."""
    files = sorted((folder or Path(__file__).parent / "scenarios").glob("*.toml"))
    return [scenario for path in files for scenario in _family(path)]


def chosen(bank: Sequence[BankScenario], only: Sequence[str], small: bool) -> list[BankScenario]:
    """Scenarios whose family is in `only` or whose name begins with a word of it; all if empty. Raises Fault CONFIG if none."""
    offered = [run for run in bank if run.bank.small or not small]
    for word in only:
        if not any(run.family == word or run.name.startswith(word) for run in offered):
            families = ", ".join(dict.fromkeys(run.family for run in offered))
            part = "the small part of the bank" if small else "the bank"
            raise Fault("CONFIG", f"--only {word}: no such family or scenario in {part}; known families: {families}")
    return [run for run in offered if not only or any(run.family == word or run.name.startswith(word) for word in only)]


def _family(path: Path) -> list[BankScenario]:
    table = read_toml(path)
    cases = cases_of(path, table)
    if not cases:
        raise Fault("CONFIG", f"{path}: has no scenario; add [[sweep]] with a value and a description for each")
    return [_scenario(path, with_overrides(table, settings)) for settings in cases.values()]


def _scenario(path: Path, table: dict[str, Any]) -> BankScenario:
    table, _ = with_rig(path, table)
    return scenario_of(path.stem, f"{path.name}: {table.get('name', 'unnamed')}", table)


def scenario_of(family: str, source: str, table: dict[str, Any]) -> BankScenario:
    """A scenario from its table, with the controller's settings added. Raises Fault CONFIG, which names `source`."""
    bank = validate(BankConfig, table.get("bank", {}), source)
    table = {key: value for key, value in table.items() if key != "bank"}
    rig = validate(RigConfig, table["rig"], source)
    table |= {"controller": merged(_controller_table(rig, bank.told), table.get("controller", {}))}
    return BankScenario(family, str(table["name"]), str(table["description"]), bank, rig, table, source)


def changed(scenario: BankScenario, name: str, duration_s: float, table: dict[str, Any]) -> BankScenario:
    """The scenario under another name, with another duration and the keys of `table`."""
    bank = scenario.bank.model_dump(exclude_defaults=True)
    table = merged(scenario.table, {"name": name, "duration_s": duration_s, "bank": bank, **table})
    return scenario_of(scenario.family, f"{scenario.name} as {name}", table)


def _controller_table(rig: RigConfig, assumed: AssumedConfig) -> dict[str, Any]:
    """The controller's table that follows from the rig."""
    stiffness_N_per_m = rig.drive.stiffness_N_per_m * assumed.drive_stiffness_ratio
    return ({"drive_stiffness_N_per_m": stiffness_N_per_m} if assumed.drive_stiffness_given else {}) | {
        "block_s": rig.solver.block_s,
        "samples_per_block": rig.solver.samples_per_block,
        "contact_resonance_Hz": math.sqrt(rig.contact.stiffness_N_per_m / rig.slide.mass_kg) / (2.0 * math.pi),
    }
