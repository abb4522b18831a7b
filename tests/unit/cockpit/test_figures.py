"""Figures of a log: their curves, their provenance, and the numbers of the curves."""

import csv
import hashlib
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from PIL import Image
from typer.testing import CliRunner

from bridge.faults import FAULTS
from bridge.log.logfile import read_run
from bridge.log.runlog import RunLog
from bridge.wire.messages import sensor_block
from bridge.wire.topics import SENSORS
from cockpit.cli import app
from cockpit.figures.curves import Grid, on_grid
from cockpit.judge.judged import judge
from cockpit.judge.verdict_words import headline, in_words
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from tests.logs import empty_log, verdict_of


def call(*arguments: str | Path):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def sawtooth_log(path: Path, slips: int = 4) -> Path:
    """Measured data of another program, at 1 kHz: the force rises by 5 N in 1 s, and falls by them in 20 ms."""
    t_s = np.arange(1000 * slips + 500) * 1e-3
    force_N = 12.0 + np.where(t_s % 1.0 < 0.98, 5.0 * (t_s % 1.0) / 0.98, 5.0 * (1.0 - t_s % 1.0) / 0.02)
    log = RunLog(path, lockstep=True)
    missing = ["mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m"]
    log.add_metadata("import", {"source": "measured.csv", "missing": missing})
    message = sensor_block(20).blank()
    for block in range(len(t_s) // 20):
        message["sequence"], message["t_ns"] = block, (block + 1) * 20_000_000
        message["drive_force_N"] = force_N[20 * block : 20 * (block + 1)]
        log.write(SENSORS, message.tobytes())
    log.close()
    return path


def test_bins_hold_the_least_the_mean_and_the_largest_sample() -> None:
    t_s = np.array([0.0, 1.0, 1.2, 0.8, 3.0, 9.0])  # not in order
    made = on_grid(t_s, np.array([5.0, 1.0, 2.0, 6.0, np.nan, 7.0]), Grid(0.0, 1.0, 4))
    nan = np.nan
    np.testing.assert_array_equal(made.least, [5.0, 1.0, nan, nan])
    np.testing.assert_array_equal(made.mean, [5.0, 3.0, nan, nan])
    np.testing.assert_array_equal(made.most, [5.0, 6.0, nan, nan])


@pytest.mark.slow
def test_a_figure_names_its_source_and_is_reproducible(log: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1700000000")
    out = log.with_name("x.svg")
    words = ["plot", log, "--out", out, "--from", "0.1s", "--to", "0.2s"]
    first, again = [(call(*words).exit_code, out.read_text()) for _ in range(2)]
    assert first == again
    assert first[0] == 0
    digest = hashlib.sha256(log.read_bytes()).hexdigest()
    for told in (f"stickslip plot {log} --out {out} --from 0.1s", f"run.mcap sha256:{digest}", "2023-11-14T22:13:20"):
        assert told in first[1]


def test_a_paper_has_its_width_and_its_metadata(log: Path) -> None:
    out = log.with_name("x.png")
    result = call("plot", log, "--out", out, "--style", "paper", "--width", "50", "--signals", "amplitude_m")
    assert result.exit_code == 0, result.output
    with Image.open(out) as picture:
        text: Any = picture.info
        assert picture.width == int(50 / 25.4 * 600)
    assert re.match(r"stickslip \d", text["Software"])
    assert "--style paper" in text["Description"]


@pytest.mark.parametrize(("to", "named"), [("0.1s", False), ("0.4s", True)])
@pytest.mark.slow
def test_a_legend_names_only_drawn_curves(tmp_path: Path, to: str, named: bool) -> None:
    path, out = tmp_path / "run.mcap", tmp_path / "x.svg"
    scenario = load_scenario("paper-c45-c45", ["duration_s=0.4", "controller.policy.enabled_from_s=0.2"])
    run_onboard(scenario, path, {"scenario": scenario.name})
    assert call("plot", path, "--out", out, "--to", to).exit_code == 0
    for words in ("controller takes over", "vibrating"):
        assert (f"<!-- {words} -->" in out.read_text()) == named, words


@pytest.mark.slow
def test_the_numbers_of_the_curves_match_the_log(log: Path) -> None:
    out, data = log.with_name("x.pdf"), log.with_name("x.csv")
    for signals in ("drive_force_N", "drive_force_N,drive_position_m"):  # its own table it replaces
        result = call("plot", log, "--vs", log, "--out", out, "--data", data, "--signals", signals)
        assert result.exit_code == 0, result.output
    rows = list(csv.DictReader(data.read_text().splitlines()))
    force_N = read_run(log).sensors["drive_force_N"]
    mine = [float(row["largest"]) for row in rows if row["signal"] == "drive_force_N"]
    assert max(mine) == pytest.approx(float(force_N.max()), rel=1e-6)
    assert {row["signal"] for row in rows} == {"drive_force_N", "drive_position_m"}


@pytest.mark.parametrize(
    ("options", "told"),
    [
        (["--from", "3s", "--to", "2s"], "--from 3 --to 2: from must be before to; exchange them"),
        (["--from", "3s"], "CONFIG: --from 3: the log is from 0.001 to 0.4 s; choose times inside"),
        (["--to", "0s"], "CONFIG: --to 0: the log is from 0.001 to 0.4 s; choose times inside"),
        (["--signals", "force"], "--signals force: unknown signal; known: drive_force_N, "),
        (["--style", "poster"], "--style poster: must be screen or paper"),
        (["--width", "2"], "--width 2: must be from 40 to 500 mm"),
        (["--data", "x.xls"], "--data x.xls: must end in .csv"),
        (["--vs", "none.mcap"], "none.mcap: no such file"),
    ],
)
def test_a_figure_that_cannot_be_drawn_is_refused_in_one_line(log: Path, options: list[str], told: str) -> None:
    result = call("plot", log, *options)
    assert result.exit_code in {2, 7}
    assert told in result.stderr
    assert result.stderr.count("\n") == 1
    assert not log.with_name("run.png").exists()


def test_a_log_without_a_block_is_not_drawn(tmp_path: Path) -> None:
    empty = empty_log(tmp_path)
    result = call("plot", empty)
    assert result.exit_code == FAULTS["BAD_LOG"].exit_status
    assert f"BAD_LOG: {empty}: has no readable sensor block, so nothing can be drawn; " in result.stderr
    assert not empty.with_suffix(".png").exists()


def test_measured_data_of_another_program_are_judged_and_drawn(tmp_path: Path) -> None:
    path = sawtooth_log(tmp_path / "measured.mcap")
    told = call("log", "info", path)
    assert told.exit_code == 0, told.output
    assert told.stdout.startswith("4 slips in 4.5 s, drive force swings by ")
    assert "imported from measured.csv: measured data of another program: no controller" in told.stdout
    drawn = call("plot", path, "--out", tmp_path / "x.png", "--data", tmp_path / "x.csv", "--json")
    assert drawn.exit_code == 0, drawn.output
    assert json.loads(drawn.stdout)["imported"] == "measured.csv"
    assert {row["signal"] for row in csv.DictReader((tmp_path / "x.csv").read_text().splitlines())} == {"drive_force_N"}
    absent = call("plot", path, "--signals", "mass_position_m")
    assert "--signals mass_position_m: not in measured.mcap; choose from drive_force_N" in absent.stderr


def test_slips_while_the_controller_takes_over_are_in_the_headline(log: Path) -> None:
    verdict = judge(log)
    assert verdict.before is not None
    before = verdict.before._replace(slips=5, slips_went_on=True)
    made = verdict._replace(
        untested="", before=before, taking_over=before._replace(slips=1), after=before._replace(slips=0)
    )
    assert headline(made) == "stick-slip is gone: 5 slips before, 1 while the controller took over, none after"
    assert "settling 1 slip in the first 0.4 s after hand-over" in "\n".join(in_words(made, verbose=True))
    assert "none with the controller in charge" in headline(made._replace(taking_over=None))
    ended = made._replace(before=before._replace(slips_went_on=False))
    assert headline(ended) == "no stick-slip with the controller in charge; the 5 slips before had ended without it"


def test_every_slip_of_a_run_is_in_one_part_of_the_verdict(tmp_path: Path) -> None:
    """The sawtooth as the force of a run whose controller is enabled at 1.5 s: slips at 0.98, 1.98, 2.98 and 3.98 s."""
    run = read_run(sawtooth_log(tmp_path / "measured.mcap"))
    settings = {"block_s": 0.02, "policy": {"enabled_from_s": 1.5}}
    verdict = verdict_of(run._replace(headers={"controller": {"configuration": json.dumps(settings)}}))
    assert [part and part.slips for part in (verdict.before, verdict.taking_over, verdict.after)] == [1, 1, 2]
