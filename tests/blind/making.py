"""Make a sealed set: draw the cases, size their effects, write the evidence, shuffle, seal."""

import json
import math
import os
import secrets
import shutil
import tempfile
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple

import joblib
import numpy as np

from bench.blind.sealing import Answer, Secret, refuse_key_inside, write_key, write_set
from bridge.faults import Fault
from bridge.results import write_json
from diagnosis.version import tool_version
from tests.blind.generators import Effect, Generator, Plan, generator
from tests.blind.sizes import OPENED, Sizes, known_sizes, write_sizes
from tests.blind.sizing import Bench
from tests.blind.strata import FEWEST, TARGETS, Drawn, draw
from tests.blind.wrong_number import EFFECT_OF, describe_wrong

Progress = Callable[[str, float], None]
_ASKED, _ANSWERS, _SET = "asked.txt", "answers", "set"  # in the folder of an unfinished set
_TRIES = 3  # strengths that are tried; more come closer to the target and take longer
_NEAR_ENOUGH = 1.4  # factor around the target within which no further strength is tried
_WEAKEST = 0.01  # strength
_INVISIBLE = 0.02  # detection limits that the search counts at least, as its steps divide by this number
VERDICTS = {"no-gap": "no-gap", "outside": "unexplained", "wrong-number": "described"}  # of the other kinds: effect
_ONE_TIME_S = 946_684_800  # time of every file, 2000-01-01, so that no time shows the order of making


class Sized(NamedTuple):
    """An effect at the strength that was found, and the detection limits that it is worth alone."""

    effect: Effect
    strength: float
    detectability: float  # detection limits


def make_set(out: Path, key: Path, name: str, cases: int, seed: int, jobs: int, progress: Progress) -> None:
    """Make a set and its key, both or neither; cases that were made before an interruption stay, with their names.

    The sizes are written next to the key, for `tests/blind/sizes`. Raises Fault CONFIG and OSError.
    """
    if cases < FEWEST:
        raise Fault("CONFIG", f"--cases {cases}: must be {FEWEST} at least, one of each kind; 200 tell something")
    refuse_key_inside(out, key)
    for option, path in (("--out", out), ("--key", key)):
        if path.exists():
            raise Fault("CONFIG", f"{option} {path}: is there already and is never overwritten; choose another")
    source = generator(name)
    part = out.parent / f".{out.name}-in-the-making"
    known = known_sizes(name, seed)
    published = bool(known) or (name, seed) in OPENED
    sealed = _taken_up(
        part, f"--generator {name} --cases {cases} --seed {seed} with version {tool_version('tests/blind')}"
    )
    done = {secret.answer["counterfactual_seed"] for secret in sealed.values()}
    todo = [case for case in draw(source, cases, seed) if case.seed not in done]
    # the draw is ordered by kind, and some file systems show the order of making
    secrets.SystemRandom().shuffle(todo)
    try:
        for case, answer in made(source, {secrets.token_hex(6): case for case in todo}, part / _SET, jobs, known):
            sealed[case] = Secret(secrets.token_hex(16), answer | {"published": published})
            write_json(part / _ANSWERS / f"{case}.json", sealed[case]._asdict())
            progress(f"{len(sealed)} of {cases} cases made", len(sealed) / cases)
    except BaseException:
        if not sealed:
            shutil.rmtree(part)
        raise
    write_set(part / _SET, sealed)
    _make_alike(part / _SET)
    write_sizes(key.with_suffix(".sizes.toml"), [secret.answer for secret in sealed.values()])
    write_key(key, sealed)
    try:
        (part / _SET).rename(out)
    except BaseException:
        key.unlink(missing_ok=True)
        raise
    shutil.rmtree(part)


def _taken_up(part: Path, asked: str) -> dict[str, Secret]:
    """The finished cases of an unfinished set, by name. Raises Fault CONFIG where the folder holds another set."""
    note = part / _ASKED
    if not part.exists():
        (part / _ANSWERS).mkdir(parents=True)
        (part / _SET).mkdir()
        note.write_text(asked, encoding="utf-8")
        return {}
    before = note.read_text(encoding="utf-8") if note.is_file() else "something else"
    if before != asked:
        line = f"{part}: holds the beginnings of {before}, not of {asked}; finish that, or delete the folder"
        raise Fault("CONFIG", line)
    kept = {
        path.stem: Secret(**json.loads(path.read_text(encoding="utf-8"))) for path in (part / _ANSWERS).glob("*.json")
    }
    for path in (part / _SET).iterdir():
        if path.is_dir() and path.name not in kept:  # ended half-way
            shutil.rmtree(path)
    return kept


def made(
    source: Generator, drawn: Mapping[str, Drawn], folder: Path, jobs: int, known: Mapping[int, Sizes]
) -> Iterator[tuple[str, Answer]]:
    """Make every case in a folder of its name; yield name and answer of each case when it is done."""
    tasks = (
        joblib.delayed(_one)(source, case, folder / name, known.get(case.seed, {})) for name, case in drawn.items()
    )
    cases_made: Any = joblib.Parallel(n_jobs=jobs, return_as="generator_unordered")(tasks)
    yield from cases_made


def _one(source: Generator, case: Drawn, folder: Path, known: Sizes) -> tuple[str, Answer]:
    plan = Plan((), case.tolerances, backbone=case.backbone)
    sizes: list[Sized] = []
    cells: list[list[Any]] = []
    if case.effects:
        with tempfile.TemporaryDirectory(prefix=f"{folder.name}-", dir=folder.parent) as scratch:
            sizes, cells = sized(source, case, plan, Path(scratch), known)
        plan = plan._replace(effects=tuple(size.effect for size in sizes))
    source.make(folder, plan, case.seed)
    effects = [
        {
            "name": one.effect.name,
            "formula": source.formula(one.effect),
            "strength": one.strength,
            "target": target,
            "detectability": round(one.detectability, 3),
        }
        for one, target in zip(sizes, case.targets, strict=True)
    ]
    number = None
    if case.stratum == "wrong-number":
        number = describe_wrong(folder, source.true_numbers(plan, case.seed), np.random.default_rng(case.seed))
        formula = f"{number['name']} is {number['true']:g}, described as {number['described']:g}"
        effects = [{"name": EFFECT_OF[number["name"]], "formula": formula, "strength": None, "detectability": None}]
    return folder.name, _answer(case, effects, cells, number)


def sized(
    source: Generator, case: Drawn, plan: Plan, scratch: Path, known: Sizes
) -> tuple[list[Sized], list[list[Any]]]:
    """Every effect of a case at the strength of its target, and the cells in which all effects together show."""
    smooth, trial, rough = plan._replace(smooth=True), scratch / "trial", scratch / "rough"

    def made(effects: tuple[Effect, ...]) -> Path:
        shutil.rmtree(trial, ignore_errors=True)
        source.make(trial, smooth._replace(effects=effects), case.seed)
        return trial

    source.make(rough, plan, case.seed)
    bench = Bench(rough, made(()))
    sizes: list[Sized] = []
    for effect, target in zip(case.effects, case.targets, strict=True):
        if effect.name in known:
            strength, limits = known[effect.name]
            sizes.append(Sized(effect.scaled(strength), strength, limits))
        else:
            sizes.append(size(lambda one: bench.detectability(made((one,))), effect, target, source.strongest))
    return sizes, bench.cells(made(tuple(size.effect for size in sizes)))


def size(worth: Callable[[Effect], float], effect: Effect, target: float, strongest: float) -> Sized:
    """The strength at which an effect is worth about `target` detection limits, or the strongest where it is never worth so much.

    Detectability grows nearly in proportion to the strength, so each try scales the last one; where that leaves the bracket,
    the geometric mean of the bracket is next. Strengths have four digits, so that a written strength makes the same effect.
    """
    strength, low, high = _four_digits(min(target / max(TARGETS), strongest)), _WEAKEST, strongest
    tried: list[tuple[float, Sized]] = []
    for _ in range(_TRIES):
        scaled = effect.scaled(strength)
        one = Sized(scaled, strength, worth(scaled))
        reached = max(one.detectability, _INVISIBLE) / target
        tried.append((abs(math.log(reached)), one))
        if 1.0 / _NEAR_ENOUGH < reached < _NEAR_ENOUGH:
            break
        low, high = (low, strength) if reached > 1.0 else (strength, high)
        if low >= high:
            break
        ahead = min(max(strength / reached, _WEAKEST), strongest)
        strength = _four_digits(ahead if low < ahead <= high else math.sqrt(low * high))
    return min(tried, key=lambda item: item[0])[1]


def _four_digits(value: float) -> float:
    return float(f"{value:.4g}")


def _answer(
    case: Drawn, effects: list[dict[str, Any]], cells: list[list[Any]], number: dict[str, Any] | None
) -> Answer:
    return {
        "stratum": case.stratum,
        "verdict": VERDICTS.get(case.stratum, "effect"),
        "effects": effects,
        "number": number,
        "tolerances": case.tolerances,
        "backbone": case.backbone,
        "counterfactual_seed": case.seed,
        "cells": cells,
    }


def _make_alike(folder: Path) -> None:
    """Give every file the same time and mode."""
    for path in (*folder.rglob("*"), folder):
        path.chmod(0o755 if path.is_dir() else 0o644)
        os.utime(path, (_ONE_TIME_S, _ONE_TIME_S))
