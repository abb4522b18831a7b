"""Three kinds of rig: the numbers that their owner states, and the true ones."""

import math
from typing import Any, NamedTuple

import numpy as np

from plant.config import RigConfig

LAWS = ("lugre", "elasto-plastic", "long-tail")  # the usual law first
_LATEST = 2.5  # standard deviations: a number further off would have failed the owner's own inspection
_VARIETY = 0.15  # relative half range of mass, stiffness and friction between two rigs of a kind


class Kind(NamedTuple):
    """A kind of rig; `numbers` as in a manifest, each with its relative tolerance; other pairs are the ends of a range."""

    name: str
    numbers: dict[str, tuple[float, float]]
    speeds_mps: tuple[float, float, float]  # slow, usual, fast
    vibration_Hz: tuple[float, float]
    amplitude_m: float
    step_s: float
    samples: tuple[tuple[float, int], ...]  # choices of block length [s] and samples per block
    bandwidth_Hz: dict[str, tuple[float, float]]
    position_noise_m: float
    accel_noise_mps2: float


KINDS = (
    Kind(
        "friction tester",
        {
            "mass_kg": (0.42, 0.01), "drive_stiffness_N_per_m": (6200.0, 0.02),
            "contact_stiffness_N_per_m": (3.1e7, 0.2), "contact_damping_Ns_per_m": (7200.0, 0.3),
            "coulomb_force_N": (4.7, 0.04), "static_force_N": (6.1, 0.04), "stribeck_velocity_mps": (8e-4, 0.25),
        },
        (3e-4, 6e-4, 1.6e-3), (1500.0, 4500.0), 3.5e-8, 1e-5, ((8e-4, 10), (1e-3, 20)),
        {"force": (800.0, 2500.0), "accel": (12000.0, 25000.0), "position": (500.0, 1500.0)}, 4e-7, 0.003,
    ),
    Kind(
        "machine slide",
        {
            "mass_kg": (18.0, 0.005), "drive_stiffness_N_per_m": (5e5, 0.03), "drive_damping_Ns_per_m": (90.0, 0.3),
            "contact_stiffness_N_per_m": (3.2e8, 0.3), "contact_damping_Ns_per_m": (1.5e5, 0.3),
            "viscous_damping_Ns_per_m": (60.0, 0.3), "coulomb_force_N": (69.0, 0.05), "static_force_N": (94.0, 0.05),
            "stribeck_velocity_mps": (1.2e-3, 0.3),
        },
        (3e-4, 6e-4, 1.2e-3), (1200.0, 4000.0), 6e-8, 1e-5, ((8e-4, 10), (1e-3, 20)),
        {"force": (1500.0, 4000.0), "accel": (10000.0, 20000.0), "position": (800.0, 2000.0)}, 3e-8, 0.004,
    ),
    Kind(
        "soft puller",
        {
            "mass_kg": (3.2, 0.01), "drive_stiffness_N_per_m": (5200.0, 0.015),
            "contact_stiffness_N_per_m": (8.4e7, 0.25), "contact_damping_Ns_per_m": (3.3e4, 0.3),
            "viscous_damping_Ns_per_m": (2.0, 0.3), "coulomb_force_N": (16.8, 0.03), "static_force_N": (20.6, 0.03),
            "stribeck_velocity_mps": (1.1e-3, 0.2),
        },
        (1.2e-3, 2.5e-3, 5e-3), (1800.0, 4000.0), 1.2e-7, 1.25e-5, ((8e-4, 8), (1e-3, 16)),
        {"force": (400.0, 1500.0), "accel": (10000.0, 18000.0), "position": (400.0, 1000.0)}, 1.5e-6, 0.002,
    ),
)  # fmt: skip


class Rig(NamedTuple):
    """One rig; `true` has the keys of `described`."""

    kind: Kind
    described: dict[str, float]
    true: dict[str, float]
    law: str
    law_number: float  # elastic ratio, or the tail of the Stribeck curve
    roughness_ratio: float
    roughness_length_m: float
    roughness_seed: int
    block_s: float
    samples_per_block: int
    sensors: dict[str, float]
    lacks: tuple[str, ...]  # channels that the bench does not have

    @property
    def units(self) -> dict[str, float]:
        """Sizes that this rig gives to the numbers of an effect, in SI units."""
        n = self.true
        m, k_d, F_s = n["mass_kg"], n["drive_stiffness_N_per_m"], n["static_force_N"]
        drop_N, swing_rad = F_s - n["coulomb_force_N"], math.sqrt(k_d / m)
        return {
            "": 1.0,
            "F_s": F_s,
            "drop/F_c": drop_N / n["coulomb_force_N"],
            "drop/F_s": drop_N / F_s,
            "critical": 2.0 * math.sqrt(k_d * m),
            "critical/speed": 2.0 * math.sqrt(k_d * m) / (drop_N / math.sqrt(k_d * m)),
            "travel": 10.0 * self.kind.speeds_mps[1],
            "F_s/travel": 0.1 * F_s / self.kind.speeds_mps[1],
            "1/k_d": 1.0 / k_d,
            "stretch": F_s / k_d,
            "slip": 2.0 * drop_N / k_d,
            "per mm2": (1e-3 * k_d / F_s) ** 2,
            "swing_s": 1.0 / swing_rad,
            "swing_Hz": swing_rad / (2.0 * math.pi),
            "top_Hz": self.kind.vibration_Hz[1],
            "speed": self.kind.speeds_mps[1],
        }

    def begins_s(self, duration_s: float) -> np.ndarray:
        """The times at which the blocks of a run begin."""
        return np.arange(round(duration_s / self.block_s)) * self.block_s

    def config(self, effects: dict[str, dict[str, float | str]]) -> RigConfig:
        """The simulated rig with effects of the library."""
        n, kind = self.true, self.kind
        law: dict[str, Any] = {}
        if self.law == "elasto-plastic":
            law = {"backbone": self.law, "elastic_ratio": self.law_number}
        elif self.law == "long-tail":
            law = {"stribeck_tail": self.law_number}
        contact = {
            **{f"{key}_N": n[f"{key}_N"] for key in ("coulomb_force", "static_force")},
            "stiffness_N_per_m": n["contact_stiffness_N_per_m"],
            "damping_Ns_per_m": n["contact_damping_Ns_per_m"],
            "viscous_damping_Ns_per_m": n.get("viscous_damping_Ns_per_m", 0.0),
            "stribeck_velocity_mps": n["stribeck_velocity_mps"],
            **{key: getattr(self, key) for key in ("roughness_ratio", "roughness_length_m", "roughness_seed")},
            **law,
        }
        drive = {
            "stiffness_N_per_m": n["drive_stiffness_N_per_m"],
            "damping_Ns_per_m": n.get("drive_damping_Ns_per_m", 0.0),
        }
        bandwidths = {key: value for key, value in self.sensors.items() if key.endswith("_bandwidth_Hz")}
        # the amplitude follows its command at once, so that the commanded columns are right in every row
        piezo = {
            "amplitude_max_m": 2.0 * kind.amplitude_m,
            "frequency_min_Hz": 500.0,
            "frequency_max_Hz": kind.vibration_Hz[1],
            "amplitude_slew_m_per_s": 0.0,
        }
        solver = {"step_s": kind.step_s, "block_s": self.block_s, "samples_per_block": self.samples_per_block}
        table = {
            "contact": contact, "slide": {"mass_kg": n["mass_kg"]}, "drive": drive, "piezo": piezo,
            "sensors": bandwidths, "solver": solver, "effects": effects,
        }  # fmt: skip
        return RigConfig.model_validate(table)


def draw_rig(random: np.random.Generator, law: str | None, tolerances: float, smooth: bool) -> Rig:
    """A rig; `law` None: a third of the rigs follow an unusual one. True numbers scatter by `tolerances` stated tolerances."""
    kind = KINDS[random.integers(len(KINDS))]
    described: dict[str, float] = {}
    load = random.uniform(1.0 - _VARIETY, 1.0 + _VARIETY)  # scales all that the contact's normal load scales
    for key, (value, _) in kind.numbers.items():
        if key in {"mass_kg", "drive_stiffness_N_per_m"}:
            factor = random.uniform(1.0 - _VARIETY, 1.0 + _VARIETY)
        else:
            factor = load if key.endswith("_force_N") or key.startswith("contact") else 1.0
        described[key] = float(f"{value * factor:.3g}")
    off = np.clip(random.standard_normal(len(described)), -_LATEST, _LATEST) * tolerances
    true = {k: v * math.exp(kind.numbers[k][1] * z) for (k, v), z in zip(described.items(), off, strict=True)}
    least_N = 1.06 * true["coulomb_force_N"]  # with less drop no rig would stick, and its owner knows that it does
    true["static_force_N"] = max(true["static_force_N"], least_N)
    drawn_law = LAWS[random.integers(1, len(LAWS))] if random.random() < 1.0 / 3.0 else LAWS[0]
    law_number = random.uniform(0.3, 0.85)
    slip_m = 2.0 * (described["static_force_N"] - described["coulomb_force_N"]) / described["drive_stiffness_N_per_m"]
    ratio = 0.001 * 30.0 ** random.random()
    length_m = slip_m * 0.02 * 50.0 ** random.random()
    roughness_seed = int(random.integers(1_000_000))
    block_s, samples = kind.samples[random.integers(len(kind.samples))]
    F_s = described["static_force_N"]
    sensors = {f"{key}_bandwidth_Hz": random.uniform(*span) for key, span in kind.bandwidth_Hz.items()}
    sensors |= {
        "force_noise_N": F_s * 0.0004 * 8.0 ** random.random(),
        "force_hum_N": F_s * 0.0003 * 5.0 ** random.random(),
        "force_step_N": 2.0 * F_s / 2**15,
        "force_late_s": random.uniform(0.0, 2e-4),
        "force_gain": 1.0 + 0.001 * random.uniform(-1.0, 1.0),
        "force_zero_N": F_s * 0.001 * random.uniform(-1.0, 1.0),
        "position_noise_m": kind.position_noise_m * random.uniform(0.5, 1.5),
        "position_step_m": kind.position_noise_m * random.uniform(0.3, 1.2),
        "accel_noise_mps2": kind.accel_noise_mps2 * random.uniform(0.5, 2.0),
        "accel_step_mps2": kind.accel_noise_mps2 * random.uniform(0.1, 0.5),
        "accel_gain": 1.0 + 0.004 * random.uniform(-1.0, 1.0),
    }
    missing = random.random()
    lacks = ("mass_accel_mps2",) if missing < 0.1 else ("base_accel_mps2",) if missing < 0.25 else ()
    return Rig(
        kind, described, true, law or drawn_law, law_number, 0.0 if smooth else ratio, length_m, roughness_seed,
        block_s, samples, sensors, lacks,
    )  # fmt: skip
