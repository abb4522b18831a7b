"""Effects that the library lacks: each changes commands, load or friction from block to block, or the reading of the force.

An actor is called before every block with a `Moment` and changes its last four fields.
"""

from collections.abc import Callable
from dataclasses import dataclass
from itertools import accumulate

import numpy as np

from tests.blind.workshop.sizes import Size


@dataclass
class Moment:
    """A rig at the begin of a block."""

    t_s: float
    block_s: float
    position_m: float  # of the slide; expected at the end of the block
    velocity_mps: float  # of the slide
    force_N: float  # in the drive
    drive_mps: float  # velocity of the drive over the block
    amplitude_m: float = 0.0  # of the exciter
    push_N: float = 0.0  # further force on the slide at the end of the block
    level: float = 1.0  # factor of both friction levels


Actor = Callable[[Moment], None]
Numbers = dict[str, float]

OUTSIDE: dict[str, dict[str, Size]] = {
    "motor-droop": {"droop": Size(0.3, 0.6), "settling_s": Size(0.02, 0.1)},
    "drive-hesitation": {"hold_s": Size(0.2, 0.5), "rate_Hz": Size(0.5, 1.2)},
    "cable-chain": {"stiffness": Size(0.2, 0.4, "F_s/travel"), "rest_m": Size(0.5, 1.0, "travel")},
    "loose-payload": {"mass_share": Size(0.25, 0.45), "frequency": Size(0.5, 1.1, "swing_Hz"), "loss": Size(0.02, 0.1)},
    "wiper-seal": {"force_N": Size(0.2, 0.4, "F_s"), "reach_m": Size(0.6, 1.5, "slip")},
    "oil-film": {"depth": Size(0.25, 0.45), "settling_s": Size(0.6, 3.0), "speed_mps": Size(0.5, 1.5, "speed")},
    "press-shocks": {
        "force_N": Size(0.25, 0.5, "F_s"), "every_s": Size(0.7, 1.7), "frequency_Hz": Size(15.0, 40.0),
        "decay_s": Size(0.04, 0.12),
    },
    "force-cell-hysteresis": {"share": Size(0.6, 1.0), "half_N": Size(0.08, 0.18, "F_s")},
    "exciter-dropouts": {"depth": Size(0.8, 1.0), "rate_Hz": Size(1.0, 2.2), "length_s": Size(0.1, 0.4)},
}  # fmt: skip


def _instants_s(random: np.random.Generator, rate_Hz: float) -> np.ndarray:
    """Random instants of half a minute."""
    return np.cumsum(random.exponential(1.0 / rate_Hz, int(60 * rate_Hz) + 20))


def _motor_droop(n: Numbers, F_s: float, _start_m: float, _random: np.random.Generator) -> Actor:
    """A motor without a speed controller turns slower the harder it pulls; the screw does not drive it backwards."""
    slower = 0.0

    def act(now: Moment) -> None:
        nonlocal slower
        load = now.force_N * np.sign(now.drive_mps) / F_s
        slower += (1.0 - np.exp(-now.block_s / n["settling_s"])) * (n["droop"] * load - slower)
        now.drive_mps *= max(1.0 - slower, 0.0)

    return act


def _drive_hesitation(n: Numbers, _F_s: float, _start_m: float, random: np.random.Generator) -> Actor:
    """A follower loses its set points for a moment, stops, and catches up at three times its speed."""
    begins_s = _instants_s(random, n["rate_Hz"])
    missing_m = 0.0

    def act(now: Moment) -> None:
        nonlocal missing_m
        since_s = now.t_s - begins_s[begins_s <= now.t_s].max(initial=-np.inf)
        if since_s < n["hold_s"]:
            missing_m += now.drive_mps * now.block_s
            now.drive_mps = 0.0
        elif missing_m != 0.0:
            more_mps = np.sign(missing_m) * min(abs(missing_m) / now.block_s, 2.0 * abs(now.drive_mps))
            missing_m -= more_mps * now.block_s
            now.drive_mps += more_mps

    return act


def _cable_chain(n: Numbers, _F_s: float, _start_m: float, _random: np.random.Generator) -> Actor:
    """A stiff cable chain pulls the slide to one place of the track."""

    def act(now: Moment) -> None:
        now.push_N -= n["stiffness"] * (now.position_m - n["rest_m"])

    return act


def _loose_payload(n: Numbers, _F_s: float, _start_m: float, _random: np.random.Generator) -> Actor:
    """A part of the mass sits on soft mounts and swings; `mass_kg` is this part."""
    omega = 2.0 * np.pi * n["frequency"]
    away_m, away_mps, before_mps = 0.0, 0.0, 0.0

    def act(now: Moment) -> None:
        nonlocal away_m, away_mps, before_mps
        away_mps += before_mps - now.velocity_mps  # the payload keeps its own velocity
        before_mps = now.velocity_mps
        pull_mps2 = omega * omega * away_m + 2.0 * n["loss"] * omega * away_mps
        away_mps -= pull_mps2 * now.block_s
        away_m += away_mps * now.block_s
        now.push_N += n["mass_kg"] * pull_mps2

    return act


def _wiper_seal(n: Numbers, _F_s: float, start_m: float, _random: np.random.Generator) -> Actor:
    """A rubber lip bends over a long way before it slides (Dahl)."""
    bent, at_m = 0.0, start_m

    def act(now: Moment) -> None:
        nonlocal bent, at_m
        moved = (now.position_m - at_m) / n["reach_m"]
        end = np.sign(moved)
        bent, at_m = end + (bent - end) * np.exp(-abs(moved)), now.position_m
        now.push_N -= n["force_N"] * bent

    return act


def _oil_film(n: Numbers, _F_s: float, _start_m: float, _random: np.random.Generator) -> Actor:
    """Motion builds a film of oil within seconds, rest squeezes it out; the film carries a part of the load."""
    film = 0.0

    def act(now: Moment) -> None:
        nonlocal film
        speed = abs(now.velocity_mps) / n["speed_mps"]
        film += now.block_s / n["settling_s"] * (min(speed, 5.0) * (1.0 - film) - film)
        now.level *= 1.0 - n["depth"] * film

    return act


def _press_shocks(n: Numbers, _F_s: float, _start_m: float, random: np.random.Generator) -> Actor:
    """A press near the bench shakes the slide with every stroke."""
    first_s = random.uniform(0.0, n["every_s"])

    def act(now: Moment) -> None:
        since_s = (now.t_s - first_s) % n["every_s"]
        if now.t_s >= first_s:
            wave = np.sin(2.0 * np.pi * n["frequency_Hz"] * since_s)
            now.push_N += n["force_N"] * wave * np.exp(-since_s / n["decay_s"])

    return act


def _exciter_dropouts(n: Numbers, _F_s: float, _start_m: float, random: np.random.Generator) -> Actor:
    """The amplifier of the exciter limits its current now and then, and the amplitude falls."""
    begins_s = _instants_s(random, n["rate_Hz"])

    def act(now: Moment) -> None:
        since_s = now.t_s - begins_s[begins_s <= now.t_s].max(initial=-np.inf)
        if since_s < n["length_s"]:
            now.amplitude_m *= 1.0 - n["depth"]

    return act


ACTORS: dict[str, Callable[[Numbers, float, float, np.random.Generator], Actor]] = {
    "motor-droop": _motor_droop,
    "drive-hesitation": _drive_hesitation,
    "cable-chain": _cable_chain,
    "loose-payload": _loose_payload,
    "wiper-seal": _wiper_seal,
    "oil-film": _oil_film,
    "press-shocks": _press_shocks,
    "exciter-dropouts": _exciter_dropouts,
}


def hysteresis_N(n: Numbers, force_N: np.ndarray) -> np.ndarray:
    """Reading of a force cell with friction in its screws: a part of it follows the force only outside a band (play)."""
    half_N = n["half_N"]
    follows = accumulate(force_N.tolist(), lambda held, force: min(max(held, force - half_N), force + half_N))
    return force_N + n["share"] * (np.fromiter(follows, float, len(force_N)) - force_N)
