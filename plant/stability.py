"""Whether steady sliding is stable: the slider on its spring, linearised, with and without a fast vibration.

States: extension of the drive's spring e [m], velocity of the slide v [m/s], bristle deflection z [m].
The vibration enters by its mean over a cycle. Well above the contact resonance, with u0 below the bristle's
largest deflection F_s / k_t, the bristle does not move within a cycle (the paper: 0.02 um against 0.22 um) and
only means remain:

    z' = v - k_t B(v) z        B(v) = < |v_r| / g(v_r) >        v_r = v - v_a cos(theta)
    F  = k_t z + h_t z' + h_v v                                 steady: F(v) = v / B(v) + h_v v

Linear stability holds for small disturbances. Stick-slip can persist where steady sliding is stable, and every start from rest
causes a first slip: see `self_sustained_velocity_mps`.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from scipy.optimize import brentq

from bridge.arrays import Floats
from plant.config import ContactConfig, RigConfig
from plant.records import build

Numbers = float | Floats

# 64 Gauss points on either side of the reversal of v_r: means to 2e-12 up to v_a = 40 v_s
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(64)


class Contact(NamedTuple):
    """The cycle-averaged contact at steady sliding: dz' = slip dv - relaxation dz. Arrays of one shape."""

    slip: Floats  # share of an extra velocity that stretches the bristle; below 0 if friction falls with velocity
    relaxation_per_s: Floats


def contact(config: ContactConfig, velocity_mps: Numbers, vibration_velocity_mps: Numbers) -> Contact:
    """Linearise the bristle. The arguments broadcast; velocities above 0, vibration 0 or more.

    The cycle is split where v_r reverses. On each part the integrand is smooth, so the mean stays exact
    through the edge v_a = v_d, where the slope of friction has a vertical tangent.
    """
    v, v_a = np.broadcast_arrays(
        np.asarray(velocity_mps, dtype=np.float64)[..., None],
        np.asarray(vibration_velocity_mps, dtype=np.float64)[..., None],
    )
    reversal = np.arccos(np.minimum(v / np.maximum(v_a, 1e-300), 1.0))
    mean = np.zeros(v.shape[:-1])
    excess = np.zeros(v.shape[:-1])
    for sign, start, end in ((-1.0, 0.0, reversal), (1.0, reversal, math.pi)):
        half = 0.5 * (end - start)
        back = v_a * np.cos(start + half * (_NODES + 1.0))
        v_r = v - back
        q = v_r / config.stribeck_velocity_mps
        drop_N, tail = config.static_force_N - config.coulomb_force_N, config.stribeck_tail
        falling, trailing = (1.0 - tail) * np.exp(-q * q), 1.0 / (1.0 + q * q)
        g = config.coulomb_force_N + drop_N * (falling + tail * trailing)
        g_slope = -2.0 * q / config.stribeck_velocity_mps * drop_N * (falling + tail * trailing * trailing)
        share = sign * half * _WEIGHTS / np.pi
        mean += np.sum(share * v_r / g, axis=-1)
        # B - v dB/dv in one sum: as a difference it would lose slopes below 1e-16
        excess += np.sum(share * (v * v_r * g_slope / g**2 - back / g), axis=-1)
    # with vibration, where the slope is 0 (F_s = F_c below the edge), the sum is rounding of 1e-16: count it as 0
    rounded = (v_a[..., 0] > 0.0) & (np.abs(excess) < 1e-14 * mean)
    return Contact(np.where(rounded, 0.0, excess / mean), config.stiffness_N_per_m * mean)


def with_constant_effects(config: RigConfig) -> RigConfig:
    """A rig without effects, with the numbers that its effects change permanently; other effects are dropped."""
    p: Any = build(config)[0][0]
    contact = {
        "coulomb_force_N": float(p.F_c),
        "static_force_N": float(p.F_s),
        "stribeck_velocity_mps": float(p.v_s),
        "viscous_damping_Ns_per_m": float(p.h_v),
    }
    drive = {"stiffness_N_per_m": float(p.k_d), "damping_Ns_per_m": float(p.h_d)}
    return config.model_copy(
        update={
            "contact": config.contact.model_copy(update=contact),
            "drive": config.drive.model_copy(update=drive),
            "effects": {},
        }
    )


def _system_matrix(config: RigConfig, at: Contact, drive_stiffness_N_per_m: Numbers) -> Floats:
    m, h_d = config.slide.mass_kg, config.drive.damping_Ns_per_m
    k_t, h_t = config.contact.stiffness_N_per_m, config.contact.damping_Ns_per_m
    h_v = config.contact.viscous_damping_Ns_per_m
    slip, relaxation, k_d = np.broadcast_arrays(at.slip, at.relaxation_per_s, drive_stiffness_N_per_m)
    A = np.zeros((*slip.shape, 3, 3))
    A[..., 0, 1] = -1.0
    A[..., 1, 0] = k_d / m
    A[..., 1, 1] = -(h_d + h_v + h_t * slip) / m
    A[..., 1, 2] = -(k_t - h_t * relaxation) / m
    A[..., 2, 1] = slip
    A[..., 2, 2] = -relaxation
    return A


def stability_map(
    config: RigConfig,
    drive_velocities_mps: Numbers,
    drive_stiffness_N_per_m: Numbers | None = None,
    vibration_velocity_mps: Numbers = 0.0,
) -> Floats:
    """Largest real part of the poles [1/s], above 0 where steady sliding is unstable.

    The arguments broadcast; without a stiffness the rig's stiffness is used. Accurate to about 1e-9 1/s; for the
    sign of weaker growth use `hurwitz_margin`.
    """
    k_d = config.drive.stiffness_N_per_m if drive_stiffness_N_per_m is None else drive_stiffness_N_per_m
    A = _system_matrix(config, contact(config.contact, drive_velocities_mps, vibration_velocity_mps), k_d)
    return np.asarray(np.max(np.linalg.eigvals(A).real, axis=-1))


def hurwitz_margin(
    config: RigConfig,
    drive_velocities_mps: Numbers,
    drive_stiffness_N_per_m: Numbers | None = None,
    vibration_velocity_mps: Numbers = 0.0,
) -> Floats:
    """Hurwitz's condition [kg^2/s^3], below 0 where steady sliding is unstable. Arguments as `stability_map`.

    The poles solve m s^3 + c2 s^2 + c1 s + k_d b = 0 with b the relaxation, H = h_d + h_v, G = k_t slip,
    tau = h_t / k_t, c2 = m b + H + tau G, c1 = H b + k_d + G. They are stable if c2, c1 > 0 and
    c2 c1 - m k_d b = c2 (H b + G) + k_d (H + tau G) > 0; the last form is free of cancellation.
    """
    k_d = config.drive.stiffness_N_per_m if drive_stiffness_N_per_m is None else drive_stiffness_N_per_m
    at = contact(config.contact, drive_velocities_mps, vibration_velocity_mps)
    H = config.drive.damping_Ns_per_m + config.contact.viscous_damping_Ns_per_m
    G = config.contact.stiffness_N_per_m * at.slip
    tau_s = config.contact.damping_Ns_per_m / config.contact.stiffness_N_per_m
    c2 = config.slide.mass_kg * at.relaxation_per_s + H + tau_s * G
    c1 = H * at.relaxation_per_s + k_d + G
    margin = c2 * (H * at.relaxation_per_s + G) + k_d * (H + tau_s * G)
    return np.where((c2 > 0.0) & (c1 > 0.0), margin, -np.abs(margin))


def _last_crossing(margin: Callable[[Numbers], Floats], grid: Floats) -> float | None:
    """The highest argument at which `margin` turns positive, between two points of the grid.

    None if `margin` is below 0 at the end of the grid; grid[0] if it is nowhere below 0.
    """
    below = np.flatnonzero(margin(grid) < 0.0)
    if below.size == 0:
        return float(grid[0])
    last = int(below[-1])
    if last == grid.size - 1:
        return None
    root: Any = brentq(margin, grid[last], grid[last + 1])
    return float(root)


def critical_velocity_mps(config: RigConfig, drive_stiffness_N_per_m: float | None = None) -> float | None:
    """Lowest drive velocity above which steady sliding is stable without vibration [m/s].

    0 if sliding is stable at every velocity; None if at no velocity: with h_d = h_v = 0, as in the paper,
    nothing opposes a friction that falls with velocity, however little it falls.
    """
    # Beyond 12 v_s the slope of the Stribeck curve, exp(-144), is below any real damping. The slope of its tail is 2e-9 of the
    # drop at 1000 v_s.
    furthest = 12.0 if config.contact.stribeck_tail == 0.0 else 1e3
    grid_mps = config.contact.stribeck_velocity_mps * np.geomspace(1e-4, furthest, 600)

    velocity_mps = _last_crossing(lambda at_mps: hurwitz_margin(config, at_mps, drive_stiffness_N_per_m), grid_mps)
    return 0.0 if velocity_mps == grid_mps[0] else velocity_mps


def stabilising_vibration_mps(config: RigConfig, drive_velocity_mps: float) -> float | None:
    """Smallest velocity amplitude of the vibration from which on steady sliding is stable [m/s].

    0 where sliding is stable without vibration; None where five times the drive velocity does not suffice.
    """
    grid_mps = drive_velocity_mps * np.linspace(0.0, 5.0, 1001)
    return _last_crossing(lambda at_mps: hurwitz_margin(config, drive_velocity_mps, None, at_mps), grid_mps)


def self_sustained_velocity_mps(config: RigConfig, drive_stiffness_N_per_m: Numbers | None = None) -> Floats:
    """Drive velocity up to which existing stick-slip persists without vibration [m/s]; inf without damping.

    A slip leaves rest at F_s and turns about F_c on the spring. In the frame of the drive it starts with the
    velocity -v_d and the spring velocity s v_d, s = (F_s - F_c) / (v_d sqrt(k_d m)), and is slowest after the
    angle 2 pi - arctan(s). The slide rests again if damping leaves it at least the velocity v_d there:
    sqrt(1 + s^2) exp(-d (2 pi - arctan(s))) = 1 at the limit, d = zeta / sqrt(1 - zeta^2).
    The result is within 10 % of the simulation for zeta up to 0.2 (tests/truth), and too low by 20 % or more at 0.4.
    """
    k_d = np.asarray(config.drive.stiffness_N_per_m if drive_stiffness_N_per_m is None else drive_stiffness_N_per_m)
    m = config.slide.mass_kg
    H = config.drive.damping_Ns_per_m + config.contact.viscous_damping_Ns_per_m
    drop_N = config.contact.static_force_N - config.contact.coulomb_force_N
    if H == 0.0:
        return np.full(k_d.shape, math.inf if drop_N > 0.0 else 0.0)
    zeta = np.minimum(H / (2.0 * np.sqrt(k_d * m)), 0.999)  # at 1 the slide never reverses; at 0.999 s is 1e54 already
    d = zeta / np.sqrt(1.0 - zeta**2)
    s = np.full(k_d.shape, np.inf)
    for _ in range(50):  # ten rounds reach 1e-11 for any zeta
        s = np.sqrt(np.expm1(2.0 * d * (2.0 * np.pi - np.arctan(s))))
    return drop_N / (s * np.sqrt(k_d * m))
