"""A case: the effects that a rig hides, and the evidence of its runs.

Each random stream has its own seed, made of the case's seed, a word and the run. So a counterfactual (the same call
without effects) has the same rig, surface, sensors, starts and noise, and differs by the effects alone.
"""

from dataclasses import dataclass
from pathlib import Path
from zlib import crc32

import numpy as np

from tests.blind.generator.chain import draw_chain, measure
from tests.blind.generator.effect import Effect, Signals
from tests.blind.generator.evidence import COLUMNS, file_name, manifest, write_run
from tests.blind.generator.kernel import SAMPLE_RATE_HZ, STATES, SUBSTEPS, integrate, place_force_N, spring_force_N
from tests.blind.generator.rig import DESCRIBED, Start, draw_rig, draw_starts
from tests.blind.generator.runs import PROTOCOL, Plan, Tracks, tracks_of
from tests.blind.generator.surface import STEP_m, draw_surface, track_m


@dataclass(frozen=True)
class Case:
    """The choices for one rig.

    backbone     a name of rig.BACKBONES; None: drawn from the seed
    tolerances   scale of the distance of the rig's numbers from the described ones; 0: exactly as described
    roughness    scale of the surface's scatter; 0: the same friction everywhere
    sensors      scale of noise, hum, drift and bow; 0: an ideal chain, bandwidth and resolution included
    leave_out    standard columns that this rig does not record
    """

    effects: tuple[Effect, ...] = ()
    backbone: str | None = None
    tolerances: float = 1.0
    leave_out: tuple[str, ...] = ()
    roughness: float = 1.0
    sensors: float = 1.0

    def __post_init__(self) -> None:
        unknown = set(self.leave_out) - set(COLUMNS[1:])
        if unknown:
            raise ValueError(f"leave_out = {sorted(unknown)}: must be among {', '.join(COLUMNS[1:])}")


def _stream(seed: int, word: str, run: int = 0) -> np.random.Generator:
    return np.random.default_rng([seed, crc32(word.encode()), run])


def _stretch_m(params: np.ndarray, force_N: float) -> tuple[float, float]:
    """Stretch of the drive spring at a force above 0, and position of its clamp's slider, by bisection [m]."""
    p = params[0]
    low, high = 0.0, 0.1
    for _ in range(80):
        middle = 0.5 * (low + high)
        slider = max(middle - p["clamp_yield_m"], 0.0) if p["clamp_share"] > 0.0 else 0.0
        if spring_force_N(p, middle, slider) < force_N:
            low = middle
        else:
            high = middle
    return middle, slider


def _steps_of(params: np.ndarray, level: np.ndarray, tracks: Tracks) -> int:
    """Steps per sample that the fastest slip needs: sigma0 |v| / g of the stiffest element is at most 1.5 per step.

    Runge-Kutta is stable up to 2.78. A slip reaches (F_s - F_c) / sqrt(k m) plus twice the drive's speed; F_s and
    F_c are taken as far apart as ageing and direction can bring them. 13 steps, unless effects make the slip twice as fast.
    """
    p = params[0]
    low, high = (float(f(level) * f(tracks.load)) for f in (np.min, np.max))
    static_N = high * p["static_force_N"] * (1.0 + abs(p["direction_static"]) + abs(p["ageing"]))
    coulomb_N = low * p["coulomb_force_N"] * (1.0 - abs(p["direction_coulomb"]))
    swing = max(static_N - coulomb_N, 0.0) / np.sqrt(p["drive_stiffness_N_per_m"] * p["mass_kg"])
    vibration = (
        2.0
        * np.pi
        * float(np.max(tracks.amplitude_m[:-1] * tracks.frequency_Hz))
        * (1.0 + 2.0 * abs(p["second_harmonic"]) + 0.5 * p["subharmonic"])
    )
    speed = swing + 2.0 * float(np.abs(tracks.drive_mps).max()) + vibration
    count = int(p["elements"])
    steepest = float(np.max(p["stiffness_share"][:count] / p["force_share"][:count]))
    rate_1_per_s = p["contact_stiffness_N_per_m"] * steepest * speed / coulomb_N
    return max(SUBSTEPS, int(np.ceil(rate_1_per_s / SAMPLE_RATE_HZ / 1.5)))


def _frame_m(params: np.ndarray, force_N: float) -> float:
    """Displacement of the frame under a force [m]."""
    p = params[0]
    if p["frame_inverse_mass_1_per_kg"] == 0.0:
        return 0.0
    return float(force_N * p["frame_inverse_mass_1_per_kg"] / p["frame_omega_radps"] ** 2)


def _run(params: np.ndarray, level: np.ndarray, start: Start, force: float, tracks: Tracks, finer: int) -> Signals:
    """The true signals of one run, at rest at t = 0 under the spring's start force [N]."""
    p = params[0]
    slider = _stretch_m(params, force)[1]
    y = np.zeros(STATES)
    y[0] = y[11] = start.position_m
    carried = force + place_force_N(p, start.position_m)  # force that the contact carries, so that the slide is at rest
    y[2:6] = carried / p["contact_stiffness_N_per_m"]
    y[6] = -_frame_m(params, force)
    if p["base_inverse_mass_1_per_kg"] > 0.0:
        y[8] = carried * p["base_inverse_mass_1_per_kg"] / p["base_omega_radps"] ** 2
    drive_m = tracks.origin_m + tracks.drive_m
    out = np.zeros((4, len(tracks.frequency_Hz)))
    integrate(
        params, y, start.age_s, slider, level, STEP_m, drive_m + tracks.unseen_m, tracks.drive_mps, tracks.load,
        tracks.amplitude_m, tracks.frequency_Hz, tracks.phase_rad, finer * _steps_of(params, level, tracks), out,
    )  # fmt: skip
    return {
        "t_s": tracks.t_s[:-1],
        "drive_force_N": out[0],
        "mass_accel_mps2": out[1],
        "base_accel_mps2": out[2],
        "mass_position_m": out[3],
        "drive_position_m": drive_m[:-1],
        "vibration_frequency_Hz": tracks.frequency_Hz,
        "vibration_amplitude_m": tracks.commanded_m[:-1],
    }


def numbers(case: Case, seed: int) -> dict[str, float]:
    """The numbers of the rig of a case without its effects, by key of the manifest."""
    params = draw_rig(_stream(seed, "rig"), case.backbone, case.tolerances)
    return {name: float(params[name][0]) for name in DESCRIBED}


def simulate(case: Case, seed: int, plans: tuple[Plan, ...] = PROTOCOL, finer: int = 1) -> list[Signals]:
    """The recorded signals of each run: standard column -> (samples,) at 20 kHz, float64.

    `finer` divides the integrator's step.
    """
    effects = [effect for effect in case.effects if effect.strength > 0.0]
    params = draw_rig(_stream(seed, "rig"), case.backbone, case.tolerances)
    coulomb_N = float(params[0]["coulomb_force_N"])  # before any effect: the start force does not depend on them
    level = draw_surface(_stream(seed, "surface"), case.roughness)
    chain = draw_chain(_stream(seed, "chain"))
    starts = draw_starts(_stream(seed, "start"), len(plans))
    for effect in effects:
        if effect.formula.rig:
            effect.formula.rig(params, effect.strength, effect.numbers)
        if effect.formula.surface:
            effect.formula.surface(track_m(), level, effect.strength, effect.numbers)
    runs = []
    for number, (plan, start) in enumerate(zip(plans, starts, strict=True)):
        force_N = start.force_share * coulomb_N
        origin_m = start.position_m + _stretch_m(params, force_N)[0] + _frame_m(params, force_N)
        tracks = tracks_of(plan, number, origin_m)
        for effect in effects:
            if effect.formula.run:
                effect.formula.run(tracks, effect.strength, effect.numbers)
        signals = _run(params, level, start, force_N, tracks, finer)
        for effect in effects:
            if effect.formula.sense:
                effect.formula.sense(signals, effect.strength, effect.numbers)
        runs.append(measure(_stream(seed, "noise", number), chain, signals, case.sensors))
    return runs


def make(folder: Path, case: Case, seed: int, plans: tuple[Plan, ...] = PROTOCOL) -> None:
    """Writes the evidence of a case: manifest.toml and a file per run. Same case and seed, same bytes."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "manifest.toml").write_text(manifest(plans), encoding="utf-8")
    for number, signals in enumerate(simulate(case, seed, plans)):
        write_run(folder / file_name(number), signals, case.leave_out)
