"""The runs that every solver has to make, and the truth that none of them provides: Runge-Kutta 4 at 1 us.

Half or twice that step moves the unvibrated slips by less than 10 ns, the vibrated ones by less than 2 us.
"""

import math
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bridge.kernel import kernel
from plant.config import RigConfig

Floats = npt.NDArray[np.float64]

PAIR = "C45-C45 @ 0.063"
RIG = RigConfig.model_validate({"contact": {"pair": PAIR}})
DRIVE_VELOCITY_MPS = RIG.drive.profile[0][1]
SAMPLE_S = 5e-5
VIBRATION_FROM_S = 8.0
# A slip begins where the slide passes 10 v_d. It accelerates smoothly there, so that samples 50 us apart
# place the slip well within a microsecond; the vibration's own 0.4 mm/s never reaches it.
SLIP_VELOCITY_MPS = 10.0 * DRIVE_VELOCITY_MPS

m, k_d = RIG.slide.mass_kg, RIG.drive.stiffness_N_per_m
k_t, h_t = RIG.contact.stiffness_N_per_m, RIG.contact.damping_Ns_per_m
F_c, F_s, v_s = RIG.contact.coulomb_force_N, RIG.contact.static_force_N, RIG.contact.stribeck_velocity_mps


class Case(NamedTuple):
    """A stretch of the paper's run from a known state, and when it slips."""

    name: str
    from_s: float
    duration_s: float
    start: Floats  # x [m], v [m/s], z [m]
    frequency_Hz: float
    amplitude_m: float
    slips_s: Floats
    end: Floats

    @property
    def omega(self) -> float:
        return 2.0 * math.pi * self.frequency_Hz

    @property
    def base_velocity_mps(self) -> float:
        """The paper's v_a."""
        return self.omega * self.amplitude_m


@kernel
def derivatives(t_s: float, x: float, v: float, z: float, v_a: float, omega: float) -> tuple[float, float, float]:
    """Rates of x, v and z."""
    v_r = v - v_a * math.cos(omega * (t_s - VIBRATION_FROM_S))
    g = F_c + (F_s - F_c) * math.exp(-((v_r / v_s) ** 2))
    z_rate = v_r - k_t * abs(v_r) * z / g
    return v, (k_d * (DRIVE_VELOCITY_MPS * t_s - x) - k_t * z - h_t * z_rate) / m, z_rate


@kernel
def runge_kutta(from_s: float, dt: float, steps: int, every: int, start: Floats, v_a: float, omega: float) -> Floats:
    """States after every `every` steps, [samples, 3]."""
    out = np.empty((steps // every, 3))
    x, v, z = start[0], start[1], start[2]
    half = 0.5 * dt
    for i in range(steps):
        t_s = from_s + i * dt
        a = derivatives(t_s, x, v, z, v_a, omega)
        b = derivatives(t_s + half, x + half * a[0], v + half * a[1], z + half * a[2], v_a, omega)
        c = derivatives(t_s + half, x + half * b[0], v + half * b[1], z + half * b[2], v_a, omega)
        d = derivatives(t_s + dt, x + dt * c[0], v + dt * c[1], z + dt * c[2], v_a, omega)
        x += dt / 6.0 * (a[0] + 2.0 * b[0] + 2.0 * c[0] + d[0])
        v += dt / 6.0 * (a[1] + 2.0 * b[1] + 2.0 * c[1] + d[1])
        z += dt / 6.0 * (a[2] + 2.0 * b[2] + 2.0 * c[2] + d[2])
        if (i + 1) % every == 0:
            sample = i // every
            out[sample, 0], out[sample, 1], out[sample, 2] = x, v, z
    return out


def slips(t_s: Floats, velocity_mps: Floats) -> Floats:
    """When slips begin [s]."""
    before, after = velocity_mps[:-1], velocity_mps[1:]
    at = np.flatnonzero((before < SLIP_VELOCITY_MPS) & (after >= SLIP_VELOCITY_MPS))
    share = (SLIP_VELOCITY_MPS - before[at]) / (after[at] - before[at])
    return t_s[at] + share * (t_s[at + 1] - t_s[at])


def error_ms(case: Case, t_s: Floats, velocity_mps: Floats) -> float:
    """Largest error of a slip time; infinite if there are more slips, or fewer."""
    found_s = slips(t_s, velocity_mps)
    if len(found_s) != len(case.slips_s):
        return math.inf
    return float(np.max(np.abs(found_s - case.slips_s))) * 1e3


def _solved(name: str, from_s: float, duration_s: float, start: Floats, f_Hz: float, u0_m: float) -> Case:
    step_s = 1e-6
    omega = 2.0 * math.pi * f_Hz
    every = round(SAMPLE_S / step_s)
    truth: Any = runge_kutta(from_s, step_s, round(duration_s / step_s), every, start, omega * u0_m, omega)
    t_s = from_s + (np.arange(len(truth)) + 1) * SAMPLE_S
    return Case(name, from_s, duration_s, start, f_Hz, u0_m, slips(t_s, truth[:, 1]), truth[-1])


def unvibrated(duration_s: float = VIBRATION_FROM_S) -> Case:
    """From rest, spring unloaded; five slips in 8 s."""
    return _solved("no vibration", 0.0, duration_s, np.zeros(3), 0.0, 0.0)


def vibrated(before: Case, duration_s: float = 1.5) -> Case:
    """On from the end of `before` with 3 kHz, 0.02 um: a slip at once, a phase-sensitive one 1.26 s on."""
    return _solved("3 kHz, 0.02 um", VIBRATION_FROM_S, duration_s, before.end, 3000.0, 2e-8)
