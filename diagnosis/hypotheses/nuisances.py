"""Nuisances, which may differ from the description without being a gap: rig numbers within tolerances, and ordinary sensors.

All of them are refitted before any effect is judged. With a missing nuisance all effects look alike: each of them imitates the
missing nuisance in another way.
"""

from bridge.arrays import Floats
from diagnosis.evidence.manifest import RigTable
from diagnosis.gap.problem import Point
from diagnosis.hypotheses.hypothesis import LEVELS, MASS
from diagnosis.model.rig import Effects
from diagnosis.model.sensor_chain import ORDINARY, SensorChain
from diagnosis.result import RigNumber

_PAPER_TRAVEL_M = 1e-2  # of the drive in the runs of the paper's rig
# Standard deviation of the tail of the Stribeck curve: a table states two friction levels and a velocity, and the curve between
# them is not exactly the Gaussian of tail 0.
_TAIL = 0.4
_NOT_NEGATIVE = ("accel_lowest_Hz", "accel_rolled_off")


class Nuisances:
    """The nuisances of a rig as a vector [nuisances] in units of their tolerances; 0 is the described rig.

    `travel_m`: of the drive; as in the paper's runs if not given.
    """

    def __init__(self, rig: RigTable, travel_m: float = _PAPER_TRAVEL_M) -> None:
        known = {name: value for name, value in rig.values().items() if value is not None}
        # a value of 0 has no relative tolerance
        self.rig_names = tuple(name for name, share in rig.tolerance.items() if share > 0.0 and known[name] > 0.0)
        self.described = known
        self.tolerance = rig.tolerance
        self._chain = ORDINARY | {"drive_bow_per_m": (0.0, ORDINARY["drive_bow_per_m"][1] / travel_m)}
        self.names = (*self.rig_names, "stribeck_tail", *self._chain)

    def __len__(self) -> int:
        return len(self.names)

    def value(self, name: str, deviation: float) -> float:
        """A number of the rig table at a deviation from its described value; at least a tenth of that value."""
        described = self.described[name]
        return described * max(1.0 + self.tolerance[name] * deviation, 0.1)

    def growth(self, name: str, deviation: float) -> float:
        """Relative growth of a number of the rig table per tolerance, at a deviation."""
        return self.tolerance[name] * self.described[name] / self.value(name, deviation)

    def _values(self, deviations: Floats) -> dict[str, float]:
        return {name: self.value(name, float(deviations[i])) for i, name in enumerate(self.rig_names)}

    def parameters(self, deviations: Floats) -> tuple[RigNumber, ...]:
        """The rig's numbers in the model at these deviations, including the shape of its Stribeck curve."""
        count = len(self.rig_names)
        values = self.described | self._values(deviations)
        values["static_force_N"] = max(values["static_force_N"], values["coulomb_force_N"])
        numbers = [RigNumber(name, self.described[name], values[name], self.tolerance[name]) for name in self.rig_names]
        return (*numbers, RigNumber("stribeck_tail", 0.0, _TAIL * float(deviations[count]), _TAIL))

    def point(self, deviations: Floats, effects: Effects) -> Point:
        """The model at these deviations, with these effects, and with another mass."""
        count = len(self.rig_names)
        values = self._values(deviations)
        values["stribeck_tail"] = _TAIL * float(deviations[count])
        chain: dict[str, float] = {}
        for (name, (mean, spread)), deviation in zip(
            self._chain.items(), deviations[count + 1 :].tolist(), strict=True
        ):
            chain[name] = mean + spread * deviation
            if name in _NOT_NEGATIVE:
                chain[name] = max(chain[name], 0.0)
        acting = {name: table for name, table in effects.items() if name != MASS}
        if MASS in effects:
            number = LEVELS[MASS]
            values[number] = values.get(number, self.described[number]) * (1.0 + float(effects[MASS]["ratio"]))
        return Point(values, SensorChain(**chain), acting)
