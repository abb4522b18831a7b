"""The page of a log: its data, no network access, refused inputs. A browser opens it in tests/system/test_review.py."""

import base64
import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from bridge.log.logfile import read_run
from cockpit.cli import app
from cockpit.judge.judged import judge
from cockpit.judge.phases import Phase
from cockpit.judge.verdict_words import headline
from cockpit.review.data import parameters_of
from cockpit.review.page import write_review
from tests.logs import Tables, doctored, short_log, tables_of, write
from tests.unit.cockpit.test_figures import sawtooth_log

MOST_BYTES = 5e6


def call(*arguments: str | Path):
    return CliRunner().invoke(app, [str(argument) for argument in arguments])


def data_in(page: Path) -> dict[str, Any]:
    match = re.search(r'<script type="application/json" id="data">(.*?)</script>', page.read_text(), re.DOTALL)
    assert match is not None
    return json.loads(match[1])


def values(text: str) -> Any:
    return np.frombuffer(base64.b64decode(text), "<f4")


def curve(data: dict[str, Any], name: str, log: int = 0) -> dict[str, Any]:
    return next(
        curve for panel in data["panels"] for curve in panel["curves"] if (curve["name"], curve["log"]) == (name, log)
    )


def test_a_curve_is_the_log_in_bins_of_a_block(log: Path) -> None:
    result = call("review", log, "--json")
    assert result.exit_code == 0, result.output
    data = data_in(log.with_name("run.html"))
    run = read_run(log)
    assert data["grid"] == {"start_s": 0.001, "step_s": 0.001, "bins": 400}
    force = curve(data, "drive_force_N")
    assert values(force["most"]).max() == pytest.approx(run.sensors["drive_force_N"].max(), rel=1e-6)
    assert (values(force["least"]) <= values(force["most"])).all()
    velocity = curve(data, "drive_velocity_mps")
    np.testing.assert_allclose(values(velocity["mean"]), 1e3 * run.trace["drive_velocity_mps"], rtol=1e-6)
    assert "most" not in velocity  # one value a bin
    assert [one["code"] for one in data["logs"][0]["events"]] == [
        event.code for event in sorted(run.events, key=lambda e: e.t_ns)
    ]
    assert json.loads(result.stdout)["logs"][0]["blocks"] == 400


def test_a_page_loads_nothing_and_no_text_of_a_log_is_markup(tmp_path: Path, log: Path) -> None:
    run = read_run(log)
    evil = "</script><script>alert(1)</script><!--"
    run.events[0].text = run.events[-1].text = evil
    path = tmp_path / "<b>.mcap"
    write(path, tables_of(run), run)
    write_review([path], tmp_path / "page.html")
    page = (tmp_path / "page.html").read_text()
    assert evil not in page
    assert "<title>&lt;b&gt;.mcap: " in page
    assert page.count("</script>") == 3
    assert not re.search(r'(?:src|href)=["\'](?!data:)', page)
    assert evil in [one["text"] for one in data_in(tmp_path / "page.html")["logs"][0]["events"]]
    assert len(page) < MOST_BYTES


def test_two_logs_share_a_time_axis_and_list_differing_settings(tmp_path: Path, log: Path) -> None:
    def shorter(tables: Tables) -> None:
        for name, table in tables.items():
            tables[name] = table[table["t_ns"] <= 300_000_000]

    run = read_run(log)
    other = doctored(tmp_path, shorter, "other.mcap")
    out = tmp_path / "both.html"
    result = call("review", log, other, "--out", out)
    assert result.exit_code == 0, result.output
    data = data_in(out)
    assert [log["label"] for log in data["logs"]] == ["A", "B"]
    assert data["differences"] == []
    second = values(curve(data, "vibration_velocity_mps", 1)["mean"])
    assert np.isfinite(second).sum() == 300
    assert len(second) == data["grid"]["bins"] == len(run.sensors)


def test_values_that_differ_are_named(tmp_path: Path, log: Path) -> None:
    run = read_run(log)
    settings = run.configuration("controller")
    settings["limits"]["v_ratio"] = 1.6
    headers = run.headers | {"controller": run.headers["controller"] | {"configuration": json.dumps(settings)}}
    other = tmp_path / "other.mcap"
    write(other, tables_of(run), run._replace(headers=headers))
    write_review([log, other], tmp_path / "both.html")
    assert data_in(tmp_path / "both.html")["differences"] == [
        {"key": "controller.limits.v_ratio", "values": ["1.2", "1.6"]}
    ]


def test_measured_data_of_another_program_have_a_page(tmp_path: Path) -> None:
    path = sawtooth_log(tmp_path / "measured.mcap")
    assert call("review", path).exit_code == 0
    data = data_in(tmp_path / "measured.html")
    assert len(data["logs"][0]["slips"]) == 4
    assert data["logs"][0]["good"] is None  # no controller to judge
    assert [panel["title"] for panel in data["panels"]] == ["Drive force"]


def test_a_log_without_a_block_and_a_third_log(tmp_path: Path, log: Path) -> None:
    def none(tables: Tables) -> None:
        for name, table in tables.items():
            tables[name] = table[:0]

    empty = doctored(tmp_path, none, "empty.mcap")
    assert call("review", empty).exit_code == 0
    third = call("review", log, log, log)
    assert third.exit_code == 2
    assert f"{log}: is the third log: a page shows one or two; leave it out" in third.stderr


def test_a_verdict_is_not_listed_as_a_parameter(log: Path) -> None:
    run = read_run(log)
    run.headers["verdict"] = {"good": "true"}
    assert not any(row["key"].startswith("verdict") for row in parameters_of([run])["parameters"])


def test_the_answer_explains_why_a_run_without_a_slip_is_not_good(tmp_path: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(short_log()[: len(short_log()) * 2 // 3])
    still = Phase(
        seconds=0.1,
        slips=0,
        slips_per_min=0.0,
        swing_N=0.0,
        strokes=0,
        mean_force_N=0.0,
        following=None,
        vibration_dose_mm2_per_s=0.0,
        slips_went_on=False,
    )
    verdict = judge(cut)._replace(after=still, untested="", alone=None)
    assert headline(verdict) == "not judged: the log ends at 0.32 s, the run was to end at 0.40 s"
    assert any("cut: has no valid end" in line for line in verdict.warnings)
