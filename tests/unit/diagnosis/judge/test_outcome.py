"""The verdict of the format from the answer of the judge, and the described numbers that were wrong."""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from bench.blind.outcomes import opened
from bridge.results import strict_json
from diagnosis.evidence.manifest import RigTable
from diagnosis.fits.fit import Fit
from diagnosis.hypotheses.hypothesis import Coordinate, Hypothesis
from diagnosis.hypotheses.nuisances import Nuisances
from diagnosis.judge.judge import Judged
from diagnosis.judge.outcome import Model, verdict_of, wrong_numbers
from diagnosis.result import Gap, WrongNumber
from tests import made_up

STATIC = WrongNumber("static_force_N", 15.88, 14.48, (14.4, 14.56), 2.96, 0.99)
MASS = WrongNumber("mass_kg", 1.5, 1.6, (1.59, 1.61), 2.2, 0.6)
IDLE = WrongNumber("contact_stiffness_N_per_m", 7.8e7, 5e7, (4e7, 6e7), 3.2, 0.0)
CLOSED, OPEN = Gap("", nominal=12.6, retuned=1.05), Gap("", nominal=12.6, retuned=5.0)
RIG: Any = {
    "drive": "spring", "mass_kg": 1.5, "drive_stiffness_N_per_m": 11700.0, "drive_damping_Ns_per_m": 0.0,
    "contact_stiffness_N_per_m": 77.52e6, "contact_damping_Ns_per_m": 2.15e4, "viscous_damping_Ns_per_m": 0.0,
    "coulomb_force_N": 14.0, "static_force_N": 17.0, "stribeck_velocity_mps": 0.0005,
}  # fmt: skip


NAMED = Gap("", nominal=12.6, retuned=5.0, with_effect=1.1, shrinkage=0.97)
PART = NAMED._replace(with_effect=3.9, shrinkage=0.3)
USELESS = NAMED._replace(with_effect=5.5, shrinkage=-0.1)


def judged(names: tuple[str, ...], complete: float) -> Judged:
    probabilities = dict.fromkeys(("static-level", "drive-damping", "friction-drift", "none"), 0.25)
    return Judged(probabilities, {frozenset(names): 1.0}, complete)


@pytest.mark.parametrize(
    ("names", "complete", "model", "expected"),
    [
        (("drive-damping",), 0.9, Model(True, (), NAMED, False), ("effect", ("drive-damping",))),
        (("drive-damping",), 0.1, Model(True, (), NAMED, False), ("partly", ("drive-damping",))),
        (("drive-damping",), 0.1, Model(True, (), USELESS, False), ("unexplained", ())),
        (("drive-damping",), 0.9, Model(False, (), CLOSED, False), ("partly", ("drive-damping",))),
        ((), 0.9, Model(True, (), CLOSED, False), ("no-gap", ())),
        ((), 0.1, Model(True, (), OPEN, False), ("unexplained", ())),
        ((), 0.9, Model(True, (), OPEN, False), ("unexplained", ())),
        (("drive-damping",), 0.9, Model(True, (), PART, False), ("partly", ("drive-damping",))),
        (("mass",), 0.9, Model(True, (MASS,), PART, False), ("unexplained", ())),
        (("static-level",), 0.9, Model(True, (STATIC,), CLOSED, False), ("described", ("static-level",))),
        (("mass",), 0.9, Model(True, (MASS,), CLOSED, False), ("described", ())),
        (("mass", "friction-drift"), 0.9, Model(True, (MASS,), NAMED, False), ("effect", ("friction-drift",))),
        (("static-level",), 0.1, Model(True, (STATIC,), CLOSED, False), ("partly", ("static-level",))),
        ((), 0.1, Model(True, (STATIC, IDLE), CLOSED, False), ("described", ("static-level",))),
        ((), 0.1, Model(True, (MASS,), CLOSED, False), ("described", ())),
        ((), 0.1, Model(True, (IDLE,), CLOSED, False), ("unexplained", ())),
        ((), 0.1, Model(True, (STATIC,), OPEN, False), ("unexplained", ())),
        ((), 0.1, Model(True, (STATIC,), CLOSED, True), ("unexplained", ())),
        ((), 0.9, Model(True, (STATIC, MASS), CLOSED, False), ("described", ("static-level",))),
        ((), 0.9, Model(True, (MASS,), CLOSED, False), ("no-gap", ())),
    ],
)
def test_the_verdict_follows_from_both_answers_and_from_the_model(
    names: tuple[str, ...], complete: float, model: Model, expected: tuple[str, tuple[str, ...]]
) -> None:
    assert verdict_of(judged(names, complete), model, ()) == expected


def test_latent_friction_names_a_part_only_where_no_formula_explains_the_runs() -> None:
    latent = ("friction-drift", "position-dependent-friction")
    unexplained, fine = judged((), 0.1), judged((), 0.9)
    assert verdict_of(unexplained, Model(True, (), OPEN, False), latent) == ("partly", latent[:1])
    assert verdict_of(unexplained, Model(True, (), OPEN, True), latent) == ("unexplained", ())
    assert verdict_of(fine, Model(True, (), CLOSED, False), latent) == ("no-gap", ())
    assert verdict_of(fine, Model(True, (), OPEN, False), latent) == ("partly", latent[:1])


def fitted(nuisances: Nuisances, deviations: dict[str, float], level: float | None) -> Fit:
    """A fit whose numbers are known within 0.04 of their tolerance and whose level within 0.004."""
    at = np.array([deviations.get(name, 0.0) for name in nuisances.names])
    axes = () if level is None else (Coordinate("coulomb-level", "ratio", 0.1, False, 3.0, -0.9, 0.9),)
    w = np.full(len(axes), 0.0 if level is None else level / 0.1)
    columns = np.diag([*(100.0 for _ in at), *(100.0 for _ in axes)])
    forms = {axis.effect: "" for axis in axes} | {"drive-damping": "viscous"}
    return Fit(Hypothesis(forms, axes), at, w, 0.0, np.zeros(len(columns)), columns)


def test_a_number_beyond_its_tolerance_is_wrong_and_one_within_it_is_not():
    nuisances = Nuisances(RigTable(**RIG, tolerance={"coulomb_force_N": 0.03, "static_force_N": 0.03}))
    fit = fitted(nuisances, {"coulomb_force_N": -2.5, "static_force_N": 1.9}, None)
    (number,) = wrong_numbers(nuisances, fit, None)
    assert (number.name, number.described, number.share) == ("coulomb_force_N", 14.0, None)
    assert number.off == pytest.approx(2.5)
    assert number.found == pytest.approx(14.0 * (1.0 - 0.075))
    low, high = number.interval_90
    assert (low + high) / 2.0 == pytest.approx(number.found)
    moved = nuisances.names.index("coulomb_force_N")
    assert high - low == pytest.approx(2.0 * 1.645 * 14.0 * 0.03 * math.sqrt(fit.covariance()[moved, moved]), rel=1e-3)


def test_a_level_and_the_refitted_number_are_one_number_and_its_share_is_that_of_leaving_out_both():
    nuisances = Nuisances(RigTable(**RIG, tolerance={"coulomb_force_N": 0.03}))
    fit = fitted(nuisances, {"coulomb_force_N": 1.0}, -0.2)
    seen: list[Fit] = []

    def share_closed(before: Fit, after: Fit) -> float:
        seen.append(before)
        assert after is fit
        return 0.8

    held_out: Any = SimpleNamespace(share_closed=share_closed)
    (number,) = wrong_numbers(nuisances, fit, held_out)
    assert number.found == pytest.approx(14.0 * 1.03 * 0.8)
    assert number.share == 0.8
    assert not seen[0].deviations.any()
    assert seen[0].hypothesis == Hypothesis({"drive-damping": "viscous"}, ())
    exact = Nuisances(RigTable(**RIG))
    (number,) = wrong_numbers(exact, fitted(exact, {}, -0.2), None)
    assert (number.found, number.off) == (pytest.approx(14.0 * 0.8), None)


def test_another_mass_changes_the_number_and_no_effect_acts() -> None:
    nuisances = Nuisances(RigTable(**RIG, tolerance={"mass_kg": 0.01}))
    heavier = np.array([1.0, *(0.0 for _ in nuisances.names[1:])])
    point = nuisances.point(heavier, {"mass": {"form": "", "ratio": 0.2}, "friction-drift": {"form": "linear"}})
    assert point.values["mass_kg"] == pytest.approx(1.5 * 1.01 * 1.2)
    assert set(point.effects) == {"friction-drift"}


def test_the_bench_reads_diagnoses_of_both_formats():
    answer = {"stratum": "one-effect", "verdict": "effect", "effects": [{"name": "drive-backlash"}]}
    new = strict_json(made_up.diagnosis())
    shares = dict(opened("new", answer, new).ranked)
    assert sum(shares.values()) == pytest.approx(sum(row["probability"] for row in new["candidates"]) * 0.98 + 0.02)
    assert (shares["drive-backlash"], shares["unexplained"]) == (pytest.approx(0.931), pytest.approx(0.02))
    old = {key: value for key, value in new.items() if key != "complete"} | {
        "format": "diagnosis/2",
        "candidates": [{"effect": name, "probability": share} for name, share in shares.items()],
    }
    assert dict(opened("old", answer, old).ranked) == shares
    unfinished = new | {"complete": None, "candidates": [{"effect": "none", "probability": None}]}
    assert dict(opened("unfinished", answer, unfinished).ranked) == {"none": 0.0, "unexplained": 0.0}
