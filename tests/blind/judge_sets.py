"""`python -m tests.blind develop`: cases with known answers for `python -m bench judge`.

    OUT/<set>/<case>/        evidence
    OUT/<set>/<case>.json    the answer, outside the evidence

Sets: `plant` (our generator), `foreign` (`tests/blind/generator`), `machines` (other rigs and friction laws), `opened` (sealed
sets that were opened, from their seeds and kept sizes) and `measured` (logs of others, clean and with a sensor fault added).
"""

import gzip
import json
import shutil
import tempfile
import tomllib
from collections import defaultdict
from collections.abc import Callable, Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np

from bench.blind.pooling import lowest_bic
from bench.blind.sealing import evidence_hash
from bridge.results import write_json
from tests.blind import sizes
from tests.blind.generator import OUTSIDE, OUTSIDE_2
from tests.blind.generators import Generator, Plan
from tests.blind.independent_cases import Independent
from tests.blind.machines import MACHINES, Machines
from tests.blind.plant_cases import Plant
from tests.blind.real_logs import real_cases
from tests.blind.sizing import Bench
from tests.blind.strata import draw
from tests.blind.wrong_number import EFFECT_OF, write_number
from tests.real.evidences import AXIS, EVIDENCES, SLIDER

SHARES = {"single": 0.4, "pair": 0.15, "none": 0.2, "outside": 0.15, "number": 0.1}
SCORES = Path(__file__).parent / "scores"
_OTHER_LAWS = {"foreign": 1 / 3, "machines": 3 / 4}  # share of cases with another friction law
_TARGETS = (3.0, 5.0, 8.0)  # detection limits of a foreign effect
# Causes that the publishers and rulers show in the measured logs (tests/real/known.py); any of the names is right.
_KNOWN = {
    "slider-fast": ("position-dependent-friction",),
    "slider-slow": ("position-dependent-friction",),
    "slider-speeds": ("position-dependent-friction",),
    "slider-stiff": ("position-dependent-friction",),
    "slider-noisy": (),  # its slips are hidden under noise
    "axis": ("direction-dependent-friction", "force-sensor-bias"),  # an offset of -3.16 N
}


class Wanted(NamedTuple):
    """A case to make: its name, and a function that writes the evidence and returns the answer."""

    name: str
    make: Callable[[Path], dict[str, Any]]


def develop(out: Path, names: list[str], count: int, seed: int, jobs: int, limits: bool) -> Iterator[str]:
    """Make the cases of these sets that are missing; yield the name of each."""
    todo = [
        (out / name, wanted)
        for name in names
        for wanted in SETS[name](count, seed)
        if not (out / name / f"{wanted.name}.json").exists()
    ]
    tasks = (joblib.delayed(_made)(folder, wanted.name, count, seed, limits) for folder, wanted in todo)
    yield from joblib.Parallel(jobs, return_as="generator", batch_size=1)(tasks)


def _made(folder: Path, name: str, count: int, seed: int, limits: bool) -> str:
    # lambdas do not travel to a worker, so it draws the set again
    wanted = next(wanted for wanted in SETS[folder.name](count, seed) if wanted.name == name)
    shutil.rmtree(folder / name, ignore_errors=True)
    answer = wanted.make(folder / name)
    source, case_seed, plan = answer.pop("made", (None, 0, None))
    if limits and source is not None and answer["kind"] in {"single", "pair"}:
        answer["limits"] = measured_limits(source, plan, case_seed)
    base = {"case": name, "set": folder.name, "limits": None, "number": None, "formulas": [], "kept": {}}
    write_json(folder / f"{name}.json", base | answer | {"sha256": evidence_hash(folder / name)})
    return name


def _plant(count: int, seed: int) -> Iterator[Wanted]:
    source = Plant("ladder")

    def strength(random: np.random.Generator, effect: Any) -> float:
        sizes_of = [form for form in _plant_forms(effect.name) if form.form == effect.others.get("form", "")]
        weakest = min(sizes_of[0].barely / sizes_of[0].large, sizes_of[0].large / sizes_of[0].barely)
        return weakest ** (0.5 * random.random())  # the upper half of the range, in logarithms

    yield from _drawn("plant", count, seed, lambda _: source, strength)


def _plant_forms(name: str) -> Any:
    from tests.blind.plant_sizes import EFFECT_SIZES

    return EFFECT_SIZES[name]


def _foreign(count: int, seed: int) -> Iterator[Wanted]:
    source = Independent(outside=(*OUTSIDE, *OUTSIDE_2))

    def strength(random: np.random.Generator, effect: Any) -> float:
        return float(np.clip(random.choice(_TARGETS) / limits_per_strength()[effect.name], 0.05, 1.5))

    yield from _drawn("foreign", count, seed, lambda _: source, strength)


@cache
def limits_per_strength() -> dict[str, float]:
    """Detection limits of an effect at strength 1 in the opened sets: the lower quartile, so that most reach their target."""
    known: dict[str, list[float]] = defaultdict(list)
    for path in Path(sizes.__file__).parent.glob("*.toml"):
        for effects in tomllib.loads(path.read_text(encoding="utf-8")).values():
            for name, (strength, limits) in effects.items():
                known[name].append(limits / strength)
    return {name: max(float(np.quantile(values, 0.25)), 0.5) for name, values in known.items()}


def _machines(count: int, seed: int) -> Iterator[Wanted]:
    sources = [Machines(name) for name in MACHINES]

    def strength(random: np.random.Generator, _effect: Any) -> float:
        return float(np.exp(random.uniform(np.log(0.6), np.log(1.3))))

    yield from _drawn("machines", count, seed, lambda number: sources[number % len(sources)], strength)


def _drawn(
    name: str,
    count: int,
    seed: int,
    source_of: Callable[[int], Generator],
    strength: Callable[[np.random.Generator, Any], float],
) -> Iterator[Wanted]:
    """Cases in the shares of `SHARES`, each effect in turn."""
    turns: dict[tuple[str, ...], list[str]] = {}
    kinds = [kind for kind, share in SHARES.items() for _ in range(max(round(share * count), 1))][:count]
    for number, kind in enumerate(kinds + ["single"] * (count - len(kinds))):
        random = np.random.default_rng([seed, number, *name.encode()])
        source = source_of(number)
        if kind == "outside" and not source.outside:
            kind = "single"  # noqa: PLW2901
        chosen: list[str] = []
        pool = source.outside if kind == "outside" else source.library
        if kind in {"single", "outside"}:
            left = turns.get(pool) or np.random.default_rng([seed, len(pool)]).permutation(pool).tolist()
            chosen, turns[pool] = [left[0]], left[1:]
        elif kind == "pair":
            chosen = random.choice(pool, 2, replace=False).tolist()
        effects = [source.draw(random, effect) for effect in chosen]
        effects = [effect.scaled(strength(random, effect)) for effect in effects]
        law = None
        if source.backbones:
            other = random.random() < _OTHER_LAWS[name]
            law = str(random.choice(source.backbones)) if other else source.usual
        plan = Plan(tuple(effects), backbone=law)
        case_seed = int(random.integers(1 << 31))
        yield Wanted(f"{name}-{seed}-{number:03d}", _maker(source, plan, case_seed, kind, chosen))


def _maker(source: Generator, plan: Plan, seed: int, kind: str, chosen: list[str]) -> Callable[[Path], dict[str, Any]]:
    def make(folder: Path) -> dict[str, Any]:
        source.make(folder, plan, seed)
        answer = {
            "kind": kind,
            "effects": chosen,
            "law": plan.backbone or "",
            "formulas": [f"{effect.strength:.3g} x {source.formula(effect)}" for effect in plan.effects],
            "made": (source, seed, plan),
        }
        return answer | wrong_number(folder, np.random.default_rng(seed)) if kind == "number" else answer

    return make


def wrong_number(folder: Path, random: np.random.Generator) -> dict[str, Any]:
    """Change one number of the description by five to eight tolerances, and 8 % at least; return the change as an answer."""
    rig = tomllib.loads((folder / "manifest.toml").read_text(encoding="utf-8"))["rig"]
    key = str(random.choice([key for key in (*EFFECT_OF, "mass_kg") if key in rig]))
    away = max(float(random.uniform(5.0, 8.0)) * rig["tolerance"][key], 0.08)
    up = bool(random.random() < 0.5)
    if key in {"coulomb_force_N", "static_force_N"}:  # static friction stays above the Coulomb friction
        room = rig["static_force_N"] / rig["coulomb_force_N"]
        up = key == "static_force_N" or (up and 1.0 + away < room)
    described = rig[key] * (1.0 + away if up else 1.0 / (1.0 + away))
    write_number(folder, key, described)
    formula = f"{key} is {rig[key]:g}, described {described:g}"
    return {"number": key, "effects": [EFFECT_OF[key]], "formulas": [formula]}


def _opened(count: int, _seed: int) -> Iterator[Wanted]:
    """Cases of the opened sets whose scores are kept, with the answers of the versions that were scored."""
    kinds = {"one-effect": "single", "two-effects": "pair", "no-gap": "none", "outside": "outside"}
    rows: list[tuple[str, int, Any]] = []
    for path in sorted(SCORES.rglob("*.json.gz")):
        kept = json.loads(gzip.decompress(path.read_bytes()))
        name = "independent-2" if path.parent != SCORES else "independent"
        seed = int(path.name.split(".")[0].split("-")[-1])
        rows += [(name, seed, row) for row in kept["cases"] if row["kind"] in kinds]
    order = np.random.default_rng(1).permutation(len(rows))[:count]
    for name, seed, row in (rows[i] for i in order):
        answer = row["answer"]
        yield Wanted(
            f"opened-{seed}-{answer['counterfactual_seed']}", _reopened(name, seed, row, kinds[answer["stratum"]])
        )


def _reopened(name: str, seed: int, row: Any, kind: str) -> Callable[[Path], dict[str, Any]]:
    def make(folder: Path) -> dict[str, Any]:
        answer = row["answer"]
        source = Independent(outside=OUTSIDE_2) if name == "independent-2" else Independent()
        case = next(case for case in _cases(name, seed) if case.seed == answer["counterfactual_seed"])
        strengths = {effect["name"]: effect["strength"] for effect in answer["effects"]}
        effects = tuple(effect.scaled(strengths[effect.name]) for effect in case.effects)
        plan = Plan(effects, case.tolerances, backbone=case.backbone)
        source.make(folder, plan, case.seed)
        probabilities = {candidate["effect"]: candidate["probability"] for candidate in row["said"]["candidates"]}
        return {
            "kind": kind,
            "effects": sorted(strengths),
            "law": case.backbone or "",
            "limits": min((effect["detectability"] for effect in answer["effects"]), default=None),
            "formulas": [effect["formula"] for effect in answer["effects"]],
            "kept": {
                "verdict then": {"outside": probabilities.pop("unexplained", 0.0), **probabilities},
                "BIC then": lowest_bic(row["said"]),
            },
        }

    return make


@cache
def _cases(name: str, seed: int) -> list[Any]:
    # twice as many as at that time, as single effects were half of a set
    return draw(Independent(outside=OUTSIDE_2) if name == "independent-2" else Independent(), 400, seed)


def _measured(_count: int, _seed: int) -> Iterator[Wanted]:
    if not (SLIDER.is_dir() and AXIS.is_dir()):
        return

    def clean(name: str) -> Callable[[Path], dict[str, Any]]:
        def make(folder: Path) -> dict[str, Any]:
            EVIDENCES[name](folder)
            return {"kind": "measured", "effects": list(_KNOWN[name]), "law": ""}

        return make

    def faulty(number: int) -> Callable[[Path], dict[str, Any]]:
        def make(folder: Path) -> dict[str, Any]:
            case = list(real_cases(np.random.default_rng(1)))[number]
            case.write(folder)
            return {"kind": "measured", "effects": list(case.effects), "law": "", "formulas": [str(case.numbers)]}

        return make

    yield from (Wanted(name, clean(name)) for name in EVIDENCES)
    faults = list(real_cases(np.random.default_rng(1)))
    yield from (Wanted(f"fault-{number:02d}", faulty(number)) for number in range(len(faults)))


def measured_limits(source: Generator, plan: Plan, seed: int) -> float:
    """Detection limits of the weakest effect of a case, from `sizing.Bench`: 20 s of CPU."""
    with tempfile.TemporaryDirectory() as scratch:

        def made(name: str, **changes: Any) -> Path:
            source.make(Path(scratch) / name, plan._replace(**changes), seed)
            return Path(scratch) / name

        bench = Bench(made("rough", effects=()), made("smooth", effects=(), smooth=True))
        return min(
            round(bench.detectability(made(effect.name, effects=(effect,), smooth=True)), 2) for effect in plan.effects
        )


SETS: dict[str, Callable[[int, int], Iterator[Wanted]]] = {
    "plant": _plant,
    "foreign": _foreign,
    "machines": _machines,
    "opened": _opened,
    "measured": _measured,
}
