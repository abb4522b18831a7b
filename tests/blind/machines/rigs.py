"""The three rigs with their runs and sensors, and a generator of their evidence folders."""

from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple
from zlib import crc32

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from tests.blind.generator.effect import Effect
from tests.blind.generators import Plan
from tests.blind.machines.effects import library, outside
from tests.blind.machines.kernel import DAHL, ELASTO_PLASTIC, LUGRE, MAXWELL, PARAMS, integrate

LAWS = {"lugre": LUGRE, "elasto-plastic": ELASTO_PLASTIC, "dahl": DAHL, "maxwell-slip": MAXWELL}
TOLERANCES = {"mass": 0.01, "stiffness": 0.02, "contact_stiffness": 0.2, "contact_damping": 0.2, "viscous": 0.1,
              "coulomb": 0.03, "static": 0.03, "stribeck": 0.15}  # fmt: skip
# number of this generator -> key of [rig]
KEYS = {"mass": "mass_kg", "stiffness": "drive_stiffness_N_per_m", "damping": "drive_damping_Ns_per_m",
        "contact_stiffness": "contact_stiffness_N_per_m", "contact_damping": "contact_damping_Ns_per_m",
        "viscous": "viscous_damping_Ns_per_m", "coulomb": "coulomb_force_N", "static": "static_force_N",
        "stribeck": "stribeck_velocity_mps"}  # fmt: skip
_POINTS = 8000  # of the friction along the track
_RAMP_S = 0.08  # duration of a change of speed


class Machine(NamedTuple):
    """A rig as described, its runs and its sensors."""

    drive: str
    numbers: dict[str, float]
    runs: tuple[
        tuple[tuple[float, float], ...], ...
    ]  # [s, speed] or, with a motor, [amplitude, Hz] each; the last is held out
    duration_s: float
    rate_Hz: int
    travel: float  # length of the track
    noise: dict[str, float]  # rms by column

    @property
    def motor(self) -> bool:
        return self.drive == "force"


MACHINES = {
    "turntable": Machine(
        "torsion",
        {"mass": 0.02, "stiffness": 40.0, "damping": 0.0, "contact_stiffness": 3750.0, "contact_damping": 9.0,
         "viscous": 0.0, "coulomb": 0.6, "static": 0.75, "stribeck": 0.02},
        (((0.0, 0.1),), ((0.0, 0.3), (3.0, -0.2), (7.0, 0.06)), ((0.0, 0.15), (3.0, 0.0), (6.5, 0.15)),
         ((0.0, 0.2), (5.0, -0.12))),
        10.0, 2000, 3.0,
        {"drive_force_N": 1.5e-3, "mass_position_m": 2e-5, "drive_position_m": 2e-5},
    ),
    "polymer": Machine(
        "spring",
        {"mass": 0.4, "stiffness": 900.0, "damping": 0.0, "contact_stiffness": 5e5, "contact_damping": 450.0,
         "viscous": 0.0, "coulomb": 1.6, "static": 2.1, "stribeck": 3e-4},
        (((0.0, 1e-3),), ((0.0, 4e-3), (3.0, -4e-3), (6.5, -0.4e-3)), ((0.0, 1.2e-3), (4.0, 0.0), (8.0, 1.2e-3)),
         ((0.0, 2e-3), (6.0, 0.7e-3))),
        12.0, 4000, 0.04,
        {"drive_force_N": 4e-3, "mass_position_m": 4e-7, "drive_position_m": 4e-7, "mass_accel_mps2": 0.02},
    ),
    "gantry": Machine(
        "force",
        {"mass": 12.0, "contact_stiffness": 9.5e5, "contact_damping": 3400.0, "viscous": 40.0, "coulomb": 15.0,
         "static": 19.0, "stribeck": 4e-3},
        (((0.03, 0.3),), ((0.008, 1.1), (0.05, 0.07)), ((0.06, 0.12),), ((0.02, 0.45), (0.04, 0.1))),
        12.0, 1000, 0.3,
        {"drive_force_N": 0.05, "mass_position_m": 3e-7},
    ),
}  # fmt: skip


@dataclass
class Tracks:
    """The inputs of one run, at the samples and one beyond."""

    number: int
    t_s: np.ndarray
    command: np.ndarray
    speed: np.ndarray
    load: np.ndarray
    mass_factor: float = 1.0


def _stream(seed: int, word: str, run: int = 0) -> np.random.Generator:
    return np.random.default_rng([seed, crc32(word.encode()), run])


def _surface(random: np.random.Generator, travel: float) -> np.ndarray:
    """Friction along the track: two or three random fields of other lengths, together 0.1 to 10 % rms."""
    total = np.zeros(_POINTS)
    for _ in range(int(random.integers(2, 4))):
        length = float(np.exp(random.uniform(np.log(2e-3), np.log(0.1))))
        wavenumber = 2.0 * np.pi * np.fft.rfftfreq(_POINTS, 1.0 / _POINTS) * length
        spectrum = np.fft.rfft(random.standard_normal(_POINTS)) / (1.0 + wavenumber**2) ** random.uniform(0.4, 0.8)
        spectrum[0] = 0.0
        field = np.fft.irfft(spectrum, _POINTS)
        total += random.uniform(0.3, 1.0) * field / field.std()
    rms = float(np.exp(random.uniform(np.log(1e-3), np.log(0.1))))
    return np.maximum(1.0 + rms * total / total.std(), 0.3)


def _rig(random: np.random.Generator, machine: Machine, law: str, spread: float) -> np.ndarray:
    p = np.zeros(1, PARAMS)
    for name, value in machine.numbers.items():
        p[name] = value * (1.0 + spread * TOLERANCES.get(name, 0.0) * np.clip(random.standard_normal(), -2.7, 2.7))
    p["static"] = np.maximum(p["static"], 1.02 * p["coulomb"])
    p["law"] = LAWS[law]
    p["elastic_share"], p["dahl_exponent"] = random.uniform(0.5, 0.9), random.uniform(1.3, 2.0)
    p["stribeck_exponent"], p["ageing_scale_s"] = random.uniform(1.3, 2.2), 1.0
    if machine.motor:
        p["motor_stiffness"], p["motor_damping"] = p["mass"] * 19.0**2, 1.4 * p["mass"] * 19.0
        p["motor_limit"] = 30.0 * p["coulomb"]
    return p


def _tracks(random: np.random.Generator, machine: Machine, number: int, origin: float) -> Tracks:
    t_s = np.arange(round(machine.duration_s * machine.rate_Hz) + 1) / machine.rate_Hz
    plan = machine.runs[number]
    if machine.motor:
        begins = np.square(np.sin(0.5 * np.pi * np.minimum(t_s, 1.0)))
        swings = [size * np.sin(2.0 * np.pi * f * t_s + random.uniform(0.0, 2.0 * np.pi)) for size, f in plan]
        command = origin + begins * np.sum(swings, axis=0)
        speed = np.gradient(command, t_s)
    else:
        knots, speeds, before = [], [], 0.0
        for begin, value in plan:
            knots += [begin, begin + _RAMP_S]
            speeds += [before, value]
            before = value
        speed = np.interp(t_s, knots, speeds)
        command = origin + np.concatenate(([0.0], np.cumsum(0.5 * (speed[1:] + speed[:-1])) / machine.rate_Hz))
    return Tracks(number, t_s, command, speed, np.ones_like(t_s))


class Machines:
    """A generator of evidence of one machine, as `tests.blind.generators.Generator` describes it."""

    usual = "lugre"
    backbones = tuple(LAWS)[1:]
    strongest = 1.5
    wide = 1.1

    def __init__(self, name: str) -> None:
        self.name = name
        self._machine = machine = MACHINES[name]
        scale = machine.travel, machine.numbers["coulomb"]
        self._formulas = {formula.effect: formula for formula in (*library(*scale, machine.drive), *outside(*scale))}
        self.library = tuple(formula.effect for formula in library(*scale, machine.drive))
        self.outside = tuple(formula.effect for formula in outside(*scale))

    def draw(self, random: np.random.Generator, name: str) -> Effect:
        formula = self._formulas[name]
        return Effect(formula, formula.draw(random))

    def formula(self, effect: Effect) -> str:
        return f"{effect.formula.name} { {name: float(value) for name, value in effect.numbers.items()} }"

    def make(self, folder: Path, plan: Plan, seed: int) -> None:
        machine = self._machine
        params = _rig(_stream(seed, "rig"), machine, plan.backbone or "lugre", plan.tolerances)
        surface = np.ones(_POINTS) if plan.smooth else _surface(_stream(seed, "surface"), machine.travel)
        for effect in plan.effects:
            if effect.formula.rig:
                effect.formula.rig(params, effect.strength, effect.numbers)
            if effect.formula.surface:
                places = np.arange(_POINTS) / _POINTS * machine.travel
                effect.formula.surface(places, surface, effect.strength, effect.numbers)
        folder.mkdir(parents=True, exist_ok=True)
        (folder / "manifest.toml").write_text(_manifest(machine), encoding="utf-8")
        for number in range(len(machine.runs)):
            columns = self._run(params, surface, plan, seed, number)
            arrays = {
                k: v if k == "t_s" else v.astype(np.float32) for k, v in columns.items() if k not in plan.leave_out
            }
            pq.write_table(pa.table(arrays), folder / f"run-{number + 1:02d}.parquet", compression="zstd")

    def _run(
        self, params: np.ndarray, surface: np.ndarray, plan: Plan, seed: int, number: int
    ) -> dict[str, np.ndarray]:
        machine, random = self._machine, _stream(seed, "run", number)
        at = machine.travel * random.uniform(0.3, 0.5)
        pull = 0.0 if machine.motor else random.uniform(0.2, 0.7) * float(params["coulomb"][0])
        origin = at if machine.motor else at + pull / float(params["stiffness"][0])
        tracks = _tracks(random, machine, number, origin)
        for effect in plan.effects:
            if effect.formula.run:
                effect.formula.run(tracks, effect.strength, effect.numbers)
        out = np.zeros((3, len(tracks.t_s) - 1))
        params = params.copy()
        params["cable_at"] = 0.4 * machine.travel
        fine = int(np.ceil(8.0 * np.sqrt(params["contact_stiffness"][0] / params["mass"][0]) / machine.rate_Hz))
        integrate(params, at, pull, surface, machine.travel / _POINTS, tracks.command, tracks.speed, tracks.load,
                  tracks.mass_factor, float(machine.rate_Hz), max(fine, 4), out)  # fmt: skip
        signals = {"t_s": tracks.t_s[:-1], "drive_force_N": out[0], "mass_position_m": out[1], "mass_accel_mps2": out[2],
                   "drive_position_m": tracks.command[:-1].copy()}  # fmt: skip
        for effect in plan.effects:
            if effect.formula.sense:
                effect.formula.sense(signals, effect.strength, effect.numbers)
        noisy = _stream(seed, "noise", number)
        for name, rms in machine.noise.items():
            step = 0.5 * rms
            signals[name] = np.round((signals[name] + rms * noisy.standard_normal(len(out[0]))) / step) * step
        return {name: signals[name] for name in ("t_s", *machine.noise)}


def _manifest(machine: Machine) -> str:
    lines = ['format = "evidence/1"', "", "[rig]", f'drive = "{machine.drive}"']
    lines += [f"{KEYS[name]} = {value!r}" for name, value in machine.numbers.items()]
    lines += ["", "[rig.tolerance]"]
    lines += [f"{KEYS[name]} = {share!r}" for name, share in TOLERANCES.items() if machine.numbers.get(name)]
    for number, plan in enumerate(machine.runs):
        lines += ["", "[[run]]", f'file = "run-{number + 1:02d}.parquet"']
        if not machine.motor and len(plan) == 1:
            lines.append(f"drive_velocity_mps = {plan[0][1]!r}")
        lines.append(f"holdout = {str(number == len(machine.runs) - 1).lower()}")
    return "\n".join(lines) + "\n"
