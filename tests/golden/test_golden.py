"""The golden logs: today's controller does the same, and the figures stay where they were, on both sides."""

import json
import subprocess
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from bridge.arrays import Records
from bridge.log.logfile import RunData, read_run
from bridge.wire.messages import COMMAND, TRACE
from cockpit.run.replay import changes_of, outcome
from cockpit.run.run_tables import processor
from controller.core import step
from controller.records import build
from controller.replay import replay, writable
from tests.golden.bless import FOLDER, make, situations

FIGURES = tomllib.loads((FOLDER / "figures.toml").read_text())


@pytest.mark.parametrize("name", situations())
def test_replay_is_identical(name: str) -> None:
    run = read_run(FOLDER / f"{name}.mcap")
    result = replay(run, changes_of(run, []))
    assert result.compared == len(run.trace) > 1000
    if json.loads(run.headers["controller"]["versions"])["processor"] == processor():
        assert result.difference is None, result.difference
        return
    # another processor: the last bit of a sine may differ, decisions may not
    again = answers(run)
    assert np.array_equal(again["mode"], run.trace["mode"])
    for field in ("force_rate", "vibration_velocity_mps", "wanted_amplitude_m"):
        np.testing.assert_allclose(again[field], run.trace[field], rtol=1e-6, atol=1e-9)


def answers(run: RunData) -> Records:
    """The traces of today's controller on the blocks of a log without a gap."""
    params, memory = build(changes_of(run, [])[0].config)
    sensors, trace, command = writable(run.sensors), TRACE.blank(len(run.trace)), COMMAND.blank()
    for i, was in enumerate(run.trace):
        step(
            params, memory, sensors[i : i + 1], int(was["events"]), int(was["gap_blocks"]), int(was["t_ns"]),
            command, trace[i : i + 1],
        )  # fmt: skip
    return trace


@pytest.mark.parametrize("name", situations())
def test_the_reference_answers_for_other_processors_match_a_replay(name: str) -> None:
    run = read_run(FOLDER / f"{name}.mcap")
    assert len(run.announce) == 0
    identical = replay(run._replace(trace=answers(run)), changes_of(run, [])).difference
    assert identical is None or identical.table == "command"


@pytest.mark.parametrize("name", situations())
def test_a_new_run_keeps_its_figures(name: str, tmp_path: Path) -> None:
    make(name, tmp_path / "now.mcap")
    now = outcome(read_run(tmp_path / "now.mcap"))._asdict()
    assert now.keys() == FIGURES[name].keys()
    for field, (low, high) in FIGURES[name].items():
        assert low <= now[field] <= high or now[field] == pytest.approx(low), field


@pytest.mark.slow
def test_blessing_demands_a_reason() -> None:
    for reason in ([], ["--reason", " "], ["--reason", "because"]):
        result = subprocess.run([sys.executable, "-m", "tests.golden.bless", *reason], capture_output=True, check=False)
        assert result.returncode != 0
        assert b"reason" in result.stderr
