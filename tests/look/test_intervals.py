"""`pytest -m nightly -s tests/look` prints how often the intervals of `look` hold the numbers of the friction law."""

import math
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
import pytest

from bench.control.drawn import drawn_axes
from diagnosis.look.look import RecordFacts, look
from plant.config import RigConfig
from plant.simulate import simulate
from tests.look.__main__ import drawn, record, slips_of

SEED, AXES, RIGS = 202, 20, 40
FEWEST_SLIPS = 8
AXIS_NOISE = 0.002  # of F_s, as the force sensors of the drawn axes
# least share of intervals that hold the number, and largest median half width; the mass has no limit
BARS = {
    "static_force_N": (0.78, 0.03),
    "kinetic_force_N": (0.78, 0.03),
    "stiffness_N_per_m": (0.78, 0.05),
    "mass_kg": (0.78, math.inf),
}


class Record(NamedTuple):
    """A record of a rig, [samples]; SI units."""

    rig: RigConfig
    t_s: Any
    force_N: Any
    position_m: Any = None
    speed_mps: float | None = None

    @property
    def truth(self) -> dict[str, float]:
        contact = self.rig.contact
        numbers = contact.static_force_N, contact.coulomb_force_N
        return dict(zip(BARS, (*numbers, self.rig.drive.stiffness_N_per_m, self.rig.slide.mass_kg), strict=True))


def records(seed: int) -> Iterator[Record]:
    """Drawn machine axes at 1 and 10 kHz, and rigs of all sizes, half of them with a damped drive."""
    random = np.random.default_rng(seed)
    for axis in drawn_axes(seed, AXES):
        made = simulate(axis.rig, min(axis.duration_s, 8.0))
        for rate_Hz in (1e3, 1e4):
            t_s = np.arange(0.0, made.t_s[-1], 1.0 / rate_Hz)
            force_N, position_m = (
                np.interp(t_s, made.t_s, values) for values in (made.drive_force_N, made.drive_position_m)
            )
            noise_N = AXIS_NOISE * axis.rig.contact.static_force_N
            yield Record(axis.rig, t_s, force_N + noise_N * random.standard_normal(len(t_s)), position_m)
    for number, one in enumerate(drawn(seed, RIGS)):
        rig = one.rig
        if number % 2:
            share = math.exp(random.uniform(math.log(0.01), math.log(0.2)))
            damping = 2.0 * share * math.sqrt(rig.drive.stiffness_N_per_m * rig.slide.mass_kg)
            rig = rig.model_copy(update={"drive": rig.drive.model_copy(update={"damping_Ns_per_m": damping})})
        made = simulate(rig, one.seconds)
        if slips_of(one, made) >= FEWEST_SLIPS:
            yield Record(rig, *record(one, made, number), speed_mps=one.speed_mps)


@pytest.mark.nightly
def test_intervals_hold_the_numbers_of_the_friction_law() -> None:
    rows: dict[str, list[tuple[bool, float]]] = {name: [] for name in BARS}
    visible = 0
    for one in records(SEED):
        seen = look(one.t_s, one.force_N, one.position_m, RecordFacts(one.speed_mps))
        if seen is None or not seen.sticks:
            continue
        visible += 1
        for name, value in one.truth.items():
            if (number := seen.numbers.get(name)) is not None:
                half = 0.5 * (number.high - number.low) / value
                rows[name].append((number.low <= value <= number.high, half))
    held = {name: float(np.mean([inside for inside, _ in of_name])) for name, of_name in rows.items()}
    for name, of_name in rows.items():
        half = float(np.nanmedian([half for _, half in of_name]))
        print(f"{name:<20} given {len(of_name)} of {visible}, holds {held[name]:.0%}, half width {half:.2%}")
        assert held[name] >= BARS[name][0]
        assert half <= BARS[name][1]
        assert len(of_name) >= 0.8 * visible
    together = np.mean([inside for of_name in rows.values() for inside, _ in of_name])
    print(f"{'together':<20} holds {together:.0%}")
    assert 0.85 <= together <= 0.97
