"""The contact in a stick: compliances of drive and contact, and the force at which the climb would saturate.

A contact whose stiffness falls from S to 0 as the force nears its limit F_l moves by -F_l / S * ln(1 - F / F_l) (Dahl, A solid
friction model, 1968), the drive by F / k. A slide that creeps breaks away below F_l, as friction falls with its speed.
"""

from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from diagnosis.look.numbers import Number, groups_of, jackknifed, mean_of

_POINTS = 64  # points of a climb, each the mean of its samples
_DEGREE = 4  # degree of the polynomial through a climb: a contact that gives way bends it once
# Limits that are tried, as multiples of the force at breakaway: a grid that a creep of 0.1 % and of 40 % fit.
_LIMITS = 1.0 + np.concatenate([[0.0], np.geomspace(1e-3, 0.4, 30)])

_RESOLVED = 2.0  # smallest compliance of the contact that shows a limit, in half intervals of 90 %


class Climb(NamedTuple):
    """The middle of a stick, [points] each; the force is a smooth curve, as noise would bias a factor of it towards zero."""

    t_s: Floats
    force_N: Floats


class Fit(NamedTuple):
    """A fit of the way over the force, [limits] each; NaN for a limit below the force."""

    drive_m_per_N: Floats
    contact_m_per_N: Floats
    left: Floats  # sum of squares that the fit leaves, over the sum of squares of the way


def climb_of(t_s: Floats, force_N: Floats) -> Climb | None:
    """A climb from its samples; None for too few."""
    each = max(len(t_s) // _POINTS, 1)
    whole = len(t_s) // each * each
    if whole // each <= 2 * _DEGREE:
        return None
    times_s, means_N = (values[:whole].reshape(-1, each).mean(axis=1) for values in (t_s - t_s[0], force_N))
    return Climb(times_s, np.polynomial.Polynomial.fit(times_s, means_N, _DEGREE)(times_s))


def fitted(climb: Climb, speed_mps: float, limits_N: Floats) -> Fit:
    """Compliances of drive and contact for each limit of the friction, [limits]: a linear fit in two columns."""
    way = speed_mps * (climb.t_s - climb.t_s.mean())
    of_drive = climb.force_N - climb.force_N.mean()
    with np.errstate(divide="ignore", invalid="ignore"):
        of_contact = -limits_N[:, None] * np.log(1.0 - climb.force_N / limits_N[:, None])
        of_contact -= of_contact.mean(axis=1, keepdims=True)
        power = of_drive @ of_drive
        shared = of_contact @ of_drive / power
        apart = of_contact - shared[:, None] * of_drive
        straight = way @ of_drive / power
        bent = way - straight * of_drive
        contact = apart @ bent / (apart**2).sum(axis=1)
        left = ((bent - contact[:, None] * apart) ** 2).sum(axis=1) / (way @ way)
    return Fit(straight - contact * shared, contact, left)


def limit_of(climbs: list[tuple[Climb, float]]) -> Number | None:
    """The limit of the friction over the force at breakaway, from all climbs with their breakaways [N].

    None where the climbs do not resolve the contact, or show no limit: a stiff contact creeps by little.
    """
    fits = [fitted(climb, 1.0, top_N * _LIMITS) for climb, top_N in climbs if top_N > 0.0]
    left = np.array([fit.left for fit in fits]).reshape(-1, len(_LIMITS))
    left[:, ~np.isfinite(left).all(axis=0)] = np.inf
    at = int(np.argmin(left.sum(axis=0)))
    contact = mean_of([float(fit.contact_m_per_N[at]) for fit in fits], "m/N")
    if contact is None or not contact.value > _RESOLVED * (contact.high - contact.value) or at == len(_LIMITS) - 1:
        return None
    without = [np.delete(left, group, axis=0).sum(axis=0) for group in groups_of(len(left))]
    limit = jackknifed(float(_LIMITS[at]), [float(_LIMITS[np.argmin(rest)]) for rest in without], "1")
    return limit if np.isfinite(limit.high) else None
