"""No fit ever holds a held-out run; tests/system/test_diagnose.py compares the digits of two whole diagnoses."""

from types import SimpleNamespace
from typing import Any

import pytest

from diagnosis.judge import witnesses
from diagnosis.judge.ledger import Ledger
from diagnosis.judge.witnesses import Witnesses, with_fits


def test_nothing_leaks_from_the_held_out_run(monkeypatch: pytest.MonkeyPatch) -> None:
    runs: Any = [SimpleNamespace(file=f"run-{number}", holdout=number == 2) for number in range(4)]
    fitted: list[str] = []
    asked: list[str] = []

    def baseline(problem: Any, *_: Any) -> Any:
        fitted.extend(run.file for run in problem.runs)
        return SimpleNamespace(fitter=SimpleNamespace(problem=problem))

    def held_out(problem: Any, *_: Any) -> Any:
        asked.extend(run.file for run in problem.runs)

    fit = SimpleNamespace(chi2=1.0)
    for name, stand_in in {
        "excerpt": lambda whole: whole,
        "Problem": lambda _rig, kept, _jobs: SimpleNamespace(runs=kept, until_s=0.0),
        "cannot_show": lambda *_: (),
        "ruled_out": lambda *_: set(),
        "trials": lambda _: [],
        "baseline_of": baseline,
        "Search": lambda rig, *_: SimpleNamespace(rig=rig, fits=[fit], run=lambda *_: None, add=lambda _: False),
        "HeldOut": held_out,
        "ledger_of": lambda _: Ledger((), (), 0.0, foreign=False),
    }.items():
        monkeypatch.setattr(witnesses, name, stand_in)
    rig = SimpleNamespace(drive_stiffness_N_per_m=0.0, static_force_N=1.0)
    evidence: Any = SimpleNamespace(rig=rig, runs=[], assumed=())
    with_fits(Witnesses(evidence, runs), lambda *_: None)
    assert fitted == ["run-0", "run-1", "run-3"]
    assert asked == ["run-2"]
