"""The oracle's verdict on a run that slips."""

import math

import pytest

from bench.control.oracle import IN_PART, LIMIT, MISSED, TOO_LATE, Oracle, ask, slew_s, verdict
from bench.control.scenario import BankScenario
from cockpit.run.scenario_file import merged
from plant.config import RigConfig
from tests.bank import BANK

PAPER = next(entry for entry in BANK if entry.name == "pair-c45-0.5")


@pytest.mark.parametrize(
    ("own", "at_once", "beforehand", "expected"),
    [
        (3, 0, 0, MISSED),
        (3, 2, 0, TOO_LATE),
        (3, 2, 1, IN_PART),
        (3, 3, 3, LIMIT),
        (3, 5, 4, LIMIT),
        (17, 16, 16, LIMIT),
        (17, 16, 15, IN_PART),
    ],
)
def test_the_counts_decide(own: int, at_once: int, beforehand: int, expected: str) -> None:
    assert verdict(own, at_once, beforehand) == expected


def test_in_words_it_gives_the_counts() -> None:
    words = Oracle(LIMIT, 3, 3, math.inf).in_words(4)
    assert (
        words
        == f"{LIMIT} (controller: 4, oracle vibrating at once: 3, 3 if it knows v_d early; best at the whole stroke)"
    )
    assert (
        Oracle(MISSED, 0, 0, 1.2).in_words(1).endswith("(controller: 1, oracle vibrating at once: 0; best at 1.2 v_d)")
    )


def test_the_slew_to_the_whole_stroke() -> None:
    piezo = PAPER.rig.piezo.model_copy(update={"amplitude_max_m": 1e-6, "amplitude_slew_m_per_s": 1e-5})
    assert slew_s(PAPER.rig.model_copy(update={"piezo": piezo})) == pytest.approx(0.1)


def with_exciter(amplitude_max_m: float) -> BankScenario:
    table = merged(PAPER.table, {"duration_s": 6.0, "rig": {"piezo": {"amplitude_max_m": amplitude_max_m}}})
    return PAPER._replace(table=table, rig=RigConfig.model_validate(table["rig"]))


@pytest.mark.slow
def test_where_the_stroke_is_too_small_the_oracle_slips_too_and_else_not() -> None:
    weak, curves = ask(with_exciter(5e-9), 2, 0.0, 3.5)  # 0.14 mm/s at 4500 Hz, of 0.5 mm/s
    assert (weak.verdict, weak.beforehand > 2) == (LIMIT, True)
    assert curves is not None
    assert curves.begin_s == 3.0
    strong, _ = ask(with_exciter(1e-7), 2, 0.0, 3.5)
    assert strong == Oracle(MISSED, 0, 0, 1.2)
