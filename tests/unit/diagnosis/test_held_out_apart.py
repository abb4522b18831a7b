"""No fit ever holds a held-out run; tests/system/test_diagnose.py compares the digits of two whole diagnoses."""

from types import SimpleNamespace
from typing import Any

import pytest

from diagnosis import diagnose


def test_nothing_leaks_from_the_held_out_run(monkeypatch: pytest.MonkeyPatch) -> None:
    runs = [SimpleNamespace(file=f"run-{number}", holdout=number == 2) for number in range(4)]
    fitted: list[str] = []
    asked: list[str] = []

    def retuned(evidence: Any, problem: Any, *_: Any) -> Any:
        fitted.extend(run.file for run in problem.runs)
        return SimpleNamespace(fitter=SimpleNamespace(problem=problem))

    def borne_out(contest: Any, judged_on: Any, _jobs: int) -> Any:
        asked.extend(run.file for run in judged_on.runs)
        raise EOFError  # everything that the test looks at was called

    contest = SimpleNamespace(
        decide=lambda _: None, rig=SimpleNamespace(fitter=SimpleNamespace(problem=SimpleNamespace()))
    )
    for name, stand_in in {
        "excerpt": lambda whole: whole,
        "Problem": lambda _rig, kept: SimpleNamespace(runs=kept, until_s=0.0),
        "cannot_show": lambda *_: (),
        "ruled_out": lambda *_: set(),
        "trials": lambda _: [],
        "retuned_rig": retuned,
        "Contest": lambda *_: contest,
        "borne_out": borne_out,
    }.items():
        monkeypatch.setattr(diagnose, name, stand_in)
    evidence = SimpleNamespace(rig=None, runs=[], assumed=())
    seen = SimpleNamespace(runs=runs, relations=SimpleNamespace(answered=()), decision=SimpleNamespace(outside=()))
    with pytest.raises(EOFError):
        diagnose._by_fits(evidence, seen, lambda *_: None, 1, (0.0, 1.0))
    assert fitted == ["run-0", "run-1", "run-3"]
    assert asked == ["run-2"]
