"""The latent friction on made rows whose shares are known, compared with a one-way analysis of variance over bins.

`python -m tests.speed.latent_friction SEED RECORDS`: one table. The rows are made of formulas that the model does not have:
sines, bumps, steps and random paths along the track, settling drifts, falling and rising friction laws, scatter with long tails.
"""

import sys
import time
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from diagnosis.latent.answer import LatentSignal, named_by, signal_of
from diagnosis.latent.causes import DIRECTION, FORCE_PLACE, LOAD, PLACE, SPEED, TIME
from diagnosis.latent.rows import BREAKAWAY, SLIDING, ExcessRows
from diagnosis.threads import one_thread

Floats = npt.NDArray[np.floating[Any]]
JUDGED = (PLACE, DIRECTION, FORCE_PLACE, TIME, SPEED, LOAD)
_BINS = {PLACE: 20, TIME: 6, SPEED: 8, LOAD: 6}  # of the rival


class Made(NamedTuple):
    """Made rows and the true course of each process in them, [rows] each."""

    rows: ExcessRows
    courses: dict[str, Floats]


def made(random: np.random.Generator) -> Made:
    """A record: a slider that passes a track once, or an axis that goes to and fro; each process is there in half of them."""
    one_pass = random.random() < 0.5
    count = int(random.integers(70, 200))
    t_s = np.arange(count) * 0.2
    run = (np.arange(count) >= 0.65 * count).astype(np.int64)
    if one_pass:
        speed, sign = np.full(count, 1e-3), np.ones(count)
        place = 1e-3 * t_s + random.normal(0.0, 2e-5, count)
    else:
        turns = float(random.uniform(3.0, 9.0))
        phase = 2.0 * np.pi * turns * np.arange(count) / count
        place, speed = 0.1 * np.sin(phase), np.abs(np.cos(phase)) * 0.1 + 1e-3
        sign = np.where(np.cos(phase) >= 0.0, 1.0, -1.0)
    load = 10.0 + np.cumsum(random.normal(0.0, 0.3, count))
    shapes = {PLACE: _along(random, place)}
    if not one_pass:
        law = np.exp(-speed / 0.01) + random.uniform(-1.0, 2.0) * np.sqrt(speed / 0.1)
        shapes[TIME] = -np.expm1(-t_s / random.uniform(0.2, 2.0) / t_s[-1])
        shapes |= {DIRECTION: sign, FORCE_PLACE: sign * _unit(_along(random, place)), SPEED: law, LOAD: load}
    courses = {
        what: _unit(shape) * (random.uniform(0.5, 2.0) if random.random() < 0.5 else 0.0)
        for what, shape in shapes.items()
    }
    scatter = random.standard_t(5, count) if random.random() < 0.5 else random.normal(0.0, 1.0, count)
    courses["scatter"] = _unit(scatter) * random.uniform(0.3, 1.0)
    excess_N = np.sum(list(courses.values()), axis=0)
    rows = ExcessRows(
        BREAKAWAY if one_pass else SLIDING, excess_N, sign, place, t_s, speed, run, run == 1,
        None if one_pass else load, None, None, 0.01,
    )  # fmt: skip
    return Made(rows, courses)


def _along(random: np.random.Generator, place: Floats) -> Floats:
    """A profile of a track: a wave, a step, a bump, or a path of some length."""
    way = (place - place.min()) / max(float(np.ptp(place)), 1e-12)
    kind = int(random.integers(4))
    if kind == 0:
        return np.sin(2.0 * np.pi * random.uniform(1.5, 6.0) * way + random.uniform(0.0, 6.0))
    if kind == 1:
        return np.tanh((way - random.uniform(0.4, 0.8)) / 0.03)
    if kind == 2:
        return np.exp(-(((way - random.uniform(0.3, 0.9)) / 0.1) ** 2))
    knots = np.linspace(0.0, 1.0, int(random.integers(6, 20)))
    return np.interp(way, knots, random.normal(size=len(knots)))


def _unit(values: Floats) -> Floats:
    return (values - values.mean()) / max(float(values.std()), 1e-12)


def true_share(record: Made, what: str) -> float:
    """The share on the held-out rows of a prediction that is the true course of every process."""
    held = record.rows.held_out
    courses = {name: (course - course[~held].mean())[held] for name, course in record.courses.items()}
    y = np.sum(list(courses.values()), axis=0)
    whole = y - courses["scatter"]
    return float(courses[what] @ (2.0 * y - whole)) / float(y @ y)


def by_bins(rows: ExcessRows, what: str) -> float:
    """The rival: omega squared of the held-out rows over bins of one variable."""
    own = rows.some(rows.held_out)
    if what == DIRECTION:
        group = (own.sign > 0.0).astype(np.int64)
    elif what == FORCE_PLACE:
        group = _binned(own.place_m, _BINS[PLACE]) * 2 + (own.sign > 0.0)
    else:
        over = {PLACE: own.place_m, TIME: own.t_s, SPEED: own.speed_mps, LOAD: own.load_N}[what]
        group = _binned(np.zeros(len(own.sign)) if over is None else over, _BINS[what])
    _, group = np.unique(group, return_inverse=True)
    counts = np.bincount(group)
    means = np.bincount(group, own.excess_N) / counts
    total = float(((own.excess_N - own.excess_N.mean()) ** 2).sum())
    inside = float(((own.excess_N - means[group]) ** 2).sum())
    free = max(len(group) - len(counts), 1)
    return max((total - inside - (len(counts) - 1) * inside / free) / (total + inside / free), 0.0)


def _binned(values: Floats, bins: int) -> npt.NDArray[np.int64]:
    edges = np.quantile(values, np.linspace(0.0, 1.0, bins + 1)[1:-1])
    return np.searchsorted(edges, values).astype(np.int64)


def _share(found: LatentSignal, what: str) -> tuple[float, tuple[float, float], bool]:
    """Share, interval, and whether it is more than chance; the share of place includes a rough track."""
    own = [share for share in found.shares if share.what == what]
    if not own:
        return 0.0, (0.0, 0.0), False
    one = own[0]
    return one.share, one.interval_90 or (0.0, 0.0), one.beyond_chance and one.agrees


def main(seed: int, records: int) -> None:
    """Print the table."""
    random = np.random.default_rng(seed)
    seen: dict[str, list[tuple[float, float, float, bool, bool]]] = {what: [] for what in JUDGED}
    named: list[float] = []
    began_s = time.process_time()
    with one_thread():
        for _ in range(records):
            record = made(random)
            found = signal_of(record.rows)
            names = named_by([found])
            named += [true_share(record, name) if name in record.courses else 0.0 for name in names[:1]]
            for what in JUDGED:
                if what not in record.courses:
                    continue
                truth = true_share(record, what)
                share, (low, high), more = _share(found, what)
                there = bool(record.courses[what].any())
                inside = low - 0.02 <= truth <= high + 0.02
                seen[what].append((abs(share - truth), abs(by_bins(record.rows, what) - truth), inside, there, more))
    print("process | records | error of the share | of bins | interval holds it | more than chance: there | absent")
    for what, rows in seen.items():
        table = np.array(rows, float)
        there = table[:, 3] > 0.0
        print(
            f"{what} | {len(table)} | {table[:, 0].mean():.3f} | {table[:, 1].mean():.3f} | {table[:, 2].mean():.2f} | "
            f"{table[there, 4].mean():.2f} | {table[~there, 4].mean():.2f}"
        )
    wrong = sum(truth < 0.25 for truth in named)
    print(f"named {len(named)}, of them with a true share below 25 %: {wrong}")
    print(f"CPU a record {(time.process_time() - began_s) / records:.2f} s")


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]))
