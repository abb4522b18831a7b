"""`python -m tests.look [SEED] [RIGS]`: the table of docs/guides/look.md; each rig is drawn, simulated and looked at."""

import math
import sys
import warnings
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from diagnosis.look.look import RecordFacts, look
from plant.config import RigConfig
from plant.simulate import Simulation, simulate
from tests.unit.diagnosis.look.rival import eight_lines

_PERIODS = 25  # of stick-slip in a record; fewer slips: the intervals are of the scatter of few
_FEWEST_SLIPS = 8
_LARGEST_STEP_PERIODS = 1 / 60  # of the swing: longer steps do not show how a slip falls
_AT_REST = 0.02  # of the drive's velocity: the slide creeps in presliding
WITHIN = 0.01  # precision of tables in tribology


class Drawn(NamedTuple):
    """A rig and how it is measured."""

    rig: RigConfig
    speed_mps: float
    seconds: float
    rate_Hz: float
    noise_N: float

    def truth(self, made: Simulation) -> dict[str, float]:
        """The true numbers. F_s is the force at breakaway, without noise: the F_s of the friction law depends on the climb."""
        contact = self.rig.contact
        fast = np.diff((made.velocity_mps > self.speed_mps).astype(int), prepend=0, append=0)
        long_s = (np.flatnonzero(fast == -1) - np.flatnonzero(fast == 1)) * (made.t_s[1] - made.t_s[0])
        return {
            "static_force_N": eight_lines(made.t_s, made.drive_force_N, self.speed_mps).static_force_N,
            "kinetic_force_N": contact.coulomb_force_N,
            "stiffness_N_per_m": self.rig.drive.stiffness_N_per_m,
            "mass_kg": self.rig.slide.mass_kg,
            # the force climbs while the drive is faster than the slide; much shorter climbs are the ring after a re-stick
            "slip_s": float(np.median(long_s[long_s > 0.5 * np.quantile(long_s, 0.9)])),
        }


def drawn(seed: int, rigs: int) -> Iterator[Drawn]:
    """Rigs that stick and slip, from a gram to a machine's table: forces, masses, stiffness, speed, rate and noise by chance."""
    random = np.random.default_rng(seed)

    def between(low: float, high: float) -> float:
        return math.exp(random.uniform(math.log(low), math.log(high)))

    while rigs:
        static_N, ratio = between(1.0, 500.0), random.uniform(0.6, 0.92)
        drop_N = static_N * (1.0 - ratio)
        reach_m = between(2e-6, 5e-4)  # that the drive goes in a stick
        stiffness = 2.0 * drop_N / reach_m
        period_s = between(0.1, 2.0)
        speed_mps = reach_m / period_s
        swing_s = period_s * between(0.01, 0.3)
        mass_kg = stiffness * (swing_s / (2.0 * math.pi)) ** 2
        sharp = stiffness * between(30.0, 3000.0)
        settings = {
            "contact": {
                "stiffness_N_per_m": sharp,
                "damping_Ns_per_m": 2.0 * math.sqrt(sharp * mass_kg),
                "coulomb_force_N": ratio * static_N,
                "static_force_N": static_N,
                # over the velocity that a slip reaches: rigs with more of it slide on
                "stribeck_velocity_mps": between(0.01, 0.3) * drop_N / math.sqrt(stiffness * mass_kg),
            },
            "slide": {"mass_kg": mass_kg},
            "drive": {"stiffness_N_per_m": stiffness, "profile": [[0.0, speed_mps]]},
            # a whole number of steps between two of the 20 samples of a block of 1 ms
            "solver": {"step_s": 5e-5 / math.ceil(5e-5 / min(1e-5, 0.2 / math.sqrt(sharp / mass_kg)))},
        }
        rate_Hz = between(500.0, 10_000.0)
        if rate_Hz * swing_s * _LARGEST_STEP_PERIODS < 1.0:
            continue
        rigs -= 1
        noise_N = drop_N * random.choice([0.0, 0.01, 0.03])
        yield Drawn(RigConfig.model_validate(settings), speed_mps, _PERIODS * period_s, rate_Hz, noise_N)


def slips_of(one: Drawn, made: Simulation) -> int:
    """How often the slide is at rest and is off again, by the plant's own velocity."""
    slow = np.abs(made.velocity_mps) < _AT_REST * one.speed_mps
    known = slow | (made.velocity_mps > 2.0 * one.speed_mps)
    return int(np.count_nonzero(np.diff(slow[known].astype(int)) == -1))


def record(one: Drawn, made: Simulation, seed: int) -> tuple[Any, Any]:
    """Its times and forces as a logger has them."""
    t_s = np.arange(0.0, made.t_s[-1], 1.0 / one.rate_Hz)
    force_N = np.interp(t_s, made.t_s, made.drive_force_N)
    return t_s, force_N + one.noise_N * np.random.default_rng(seed).standard_normal(len(t_s))


def main(seed: int, rigs: int) -> None:
    """Print the table."""
    errors: dict[str, list[tuple[float, float, bool]]] = {}
    missing: dict[str, int] = {}
    stick_and_slip = alike = rival_alike = silent = 0
    for number, drawn_rig in enumerate(drawn(seed, rigs)):
        made = simulate(drawn_rig.rig, drawn_rig.seconds)
        slips = slips_of(drawn_rig, made)
        if slips < _FEWEST_SLIPS:
            continue
        stick_and_slip += 1
        t_s, force_N = record(drawn_rig, made, number)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", np.exceptions.RankWarning)  # its line through a stick of two samples
            try:
                rival = eight_lines(t_s, force_N, drawn_rig.speed_mps)
            except IndexError:  # it finds no peak after a trough
                rival = None
        rival_alike += rival is not None and abs(rival.slips - slips) <= 1
        seen = look(t_s, force_N, None, RecordFacts(drawn_rig.speed_mps))
        if seen is None or "static_force_N" not in seen.numbers:
            silent += 1
            continue
        alike += abs(seen.slips - slips) <= 1
        for name, value in drawn_rig.truth(made).items():
            found = seen.numbers.get(name)
            if found is None:
                missing[name] = missing.get(name, 0) + 1
                continue
            own, theirs = (abs(figure / value - 1.0) for figure in (found.value, getattr(rival, name, np.nan)))
            errors.setdefault(name, []).append((own, theirs, found.low <= value <= found.high))
    print(f"seed {seed}: {rigs} rigs drawn, {stick_and_slip} stick and slip, {silent} of them get no answer")
    print(f"slips within 1 of the plant's: {alike}, rival {rival_alike}; numbers not told: {missing or 'none'}\n")
    print("| number | median error: look, rival | within 1 %: look, rival | the interval holds it |\n|---|---|---|---|")
    for name, rows in errors.items():
        table = np.array(rows)
        own, theirs = np.median(table[:, :2], axis=0)
        near = (table[:, :2] <= WITHIN).mean(axis=0)
        print(f"| {name} | {own:.2%}, {theirs:.2%} | {near[0]:.0%}, {near[1]:.0%} | {table[:, 2].mean():.0%} |")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1, int(sys.argv[2]) if len(sys.argv) > 2 else 100)
