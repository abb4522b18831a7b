"""Motion of a mass under one of four friction laws, pulled through a spring or pushed by a controlled motor.

Steps are semi-implicit (velocity, then position). The bristle of LuGre follows its exact solution for a constant velocity within
a step. Lengths are m, or rad on a rotary rig, and forces N or N m.
"""

import math

import numba as nb
import numpy as np

LUGRE, ELASTO_PLASTIC, DAHL, MAXWELL = range(4)
ELEMENTS = 4  # of the Maxwell slip law
PARAMS = np.dtype([(name, "f8") for name in (
    "mass", "stiffness", "damping", "contact_stiffness", "contact_damping", "viscous", "coulomb", "static", "stribeck",
    "law", "elastic_share", "dahl_exponent", "stribeck_exponent", "motor_stiffness", "motor_damping", "motor_limit",
    "quadratic", "direction", "ageing", "ageing_scale_s", "lag_s", "hardening", "knee", "backlash",
    "frame_stiffness", "frame_damping", "cable", "cable_at", "cogging", "cogging_per_m", "inner_share", "inner_radps",
)])  # fmt: skip


@nb.njit(cache=True)
def _pull(p, stretch):
    """Static force of the drive spring."""
    if p.backlash > 0.0:
        stretch = math.copysign(max(abs(stretch) - 0.5 * p.backlash, 0.0), stretch)
    over = max(abs(stretch) - p.knee, 0.0)
    return p.stiffness * (stretch + math.copysign(p.hardening * over * over / max(p.knee, 1e-12), stretch))


@nb.njit(cache=True)
def _bristle(p, z, v, limit, h):
    """Deflection after a step at a constant velocity; `limit` is the deflection of steady sliding."""
    if p.law == LUGRE:
        steady = math.copysign(limit, v)
        return steady + (z - steady) * math.exp(-abs(v) * h / limit)
    share = z / limit * (1.0 if v >= 0.0 else -1.0)  # positive while the motion loads the bristle
    if p.law == DAHL:
        left = 1.0 - share
        rate = math.copysign(abs(left) ** p.dahl_exponent, left)
    else:
        slides = 0.0
        if share >= 1.0:
            slides = 1.0
        elif share > p.elastic_share:
            slides = 0.5 - 0.5 * math.cos(math.pi * (share - p.elastic_share) / (1.0 - p.elastic_share))
        rate = 1.0 - slides * share
    moved = z + v * h * rate
    return min(max(moved, -1.5 * limit), 1.5 * limit)


@nb.njit(cache=True)
def integrate(params, at, pull, level, level_step, command, speed, load, mass_factor, rate_Hz, substeps, out):
    """Fill `out` (3, samples): drive force, position and acceleration of the mass, at the start of each sample.

    params (1,) PARAMS; at, pull: position and drive force at rest; level: friction along the track; command, speed, load
    (samples + 1,): position and velocity of the drive, or of the motor's reference, and factor on friction.
    """
    p = params[0]
    h = 1.0 / rate_Hz / substeps
    mass = p.mass * mass_factor
    x, v, frame, rest_s, past_v, inner, inner_v = at, 0.0, 0.0, 5.0, 0.0, at, 0.0
    z = np.full(ELEMENTS, pull / p.contact_stiffness)
    motor = p.motor_stiffness > 0.0
    if not motor and p.frame_stiffness > 0.0:
        frame = -pull / p.frame_stiffness
    force = pull
    for n in range(out.shape[1]):
        if motor:
            wanted = p.motor_stiffness * (command[n] - x) + p.motor_damping * (speed[n] - v)
            force = min(max(wanted, -p.motor_limit), p.motor_limit)
        for j in range(substeps):
            f = (j + 0.5) / substeps
            if not motor:
                s = command[n] + f * (command[n + 1] - command[n])
                force = _pull(p, s + frame - x) + p.damping * (speed[n] - v)
            place = min(max(x / level_step, 0.0), len(level) - 1.001)
            i = int(place)
            factor = (level[i] + (place - i) * (level[i + 1] - level[i])) * (load[n] + f * (load[n + 1] - load[n]))
            seen = abs(past_v) if p.lag_s > 0.0 else abs(v)
            share = 1.0 / (1.0 + (seen / p.stribeck) ** p.stribeck_exponent)
            aged = p.ageing * math.log1p(rest_s / p.ageing_scale_s) if p.ageing != 0.0 else 0.0
            side = 1.0 if v >= 0.0 else -1.0
            rise = max(p.static * (1.0 + aged) - p.coulomb, 0.002 * p.coulomb)
            g = factor * (p.coulomb + rise * share) * (1.0 + p.direction * side)
            friction = 0.0
            if p.law == MAXWELL:
                for e in range(ELEMENTS):  # four elements of equal force, whose ways to slip are 0.4 to 1.6 of the mean
                    limit = g / p.contact_stiffness * (0.4 + 0.4 * e)
                    moved = min(max(z[e] + v * h, -limit), limit)
                    friction += g / ELEMENTS * moved / limit + p.contact_damping / ELEMENTS * (moved - z[e]) / h
                    z[e] = moved
            else:
                moved = _bristle(p, z[0], v, g / p.contact_stiffness, h)
                friction = p.contact_stiffness * moved + p.contact_damping * (moved - z[0]) / h
                z[0] = moved
            friction += p.viscous * v + p.quadratic * v * abs(v)
            total = force - friction - p.cable * (x - p.cable_at) - p.cogging * math.sin(p.cogging_per_m * x)
            if p.inner_share > 0.0:
                swing = p.inner_radps * p.inner_radps * (inner - x) + 0.04 * p.inner_radps * (inner_v - v)
                total += p.inner_share * mass * swing
                inner_v -= h * swing
                inner += h * inner_v
            accel = total / mass
            if j == 0:
                out[0, n] = force
                out[1, n] = x
                out[2, n] = accel
            v += h * accel
            x += h * v
            if p.frame_stiffness > 0.0:
                frame += h * (-force - p.frame_stiffness * frame) / p.frame_damping
            if p.lag_s > 0.0:
                past_v += h / p.lag_s * (v - past_v)
            if abs(v) < 0.05 * p.stribeck:
                rest_s += h
            else:
                rest_s *= math.exp(-h * abs(v) * p.contact_stiffness / p.static)
