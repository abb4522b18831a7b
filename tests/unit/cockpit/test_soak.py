"""The report of a soak on its log and on the memory of its processes."""

import math
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from bridge.log.logfile import read_run
from bridge.log.runlog import Rotation
from bridge.log.storage.parts import parts_of
from bridge.results import strict_json
from bridge.wire.zenoh_link import BusConfig
from cockpit.judge.judged import judge
from cockpit.run import soak
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario
from cockpit.run.soak import Soaked
from tests.logs import tables_of, write
from tests.system.ports import free_endpoint


def soaked(folder: Path, lost: int = 0, thin_out: bool = False, damaged: bool = False) -> Soaked:
    """Of a log of 1.2 s in several files, the last of which is judged at the end; its commands take 0.3 ms, each 100th 2 ms."""
    log = folder / "soak.mcap"
    whole = folder / "whole.mcap"
    settings = ["duration_s=1.2", "controller.policy.enabled_from_s=0.1"]
    run_onboard(load_scenario("paper-c45-c45", settings), whole, {})
    run = read_run(whole)
    tables = tables_of(run)
    tables["applied"]["commands"] = 1
    tables["applied"]["round_trip_ns"] = 300_000
    tables["applied"]["round_trip_ns"][::100] = 2_000_000
    tables["applied"]["commands_late"][::100] = 1
    tables["sensors"] = np.delete(tables["sensors"], slice(700, 700 + lost))
    write(log, tables, run, 200, Rotation(bytes=200_000))
    assert len(parts_of(log)) > 2
    watch = soak._Watch(BusConfig(endpoint=free_endpoint()), 20.0, log, thin_out, lambda _share: None)
    watch._period_s = 0.5
    if damaged:
        data = bytearray(parts_of(log)[1].read_bytes())
        data[len(data) // 2] ^= 1
        parts_of(log)[1].write_bytes(data)
    watch._judge_files(still_open=1)
    watch._memory["recorder"] = [(t_s, 100.0 + 2.0 * t_s / 3600.0) for t_s in range(20)]
    return watch.result("belt", interrupted=False)


def test_lost_blocks_latency_and_memory_are_reported(tmp_path: Path) -> None:
    came = soaked(tmp_path, lost=3)
    assert (came.verdict.blocks, came.verdict.lost_blocks, came.good) == (1197, 3, False)
    assert [(period.until_s, period.blocks, period.late) for period in came.periods] == [
        (0.5, 500, 5),
        (1.0, 500, 5),
        (1.2, 200, 2),
    ]
    assert came.periods[0].p50_us == pytest.approx(300.0, rel=3e-3)
    assert came.periods[0].max_us == 2000.0
    (memory,) = came.memory
    assert memory.role == "recorder"
    assert memory.slope_MB_per_h == pytest.approx(2.0)
    assert "data     3 of 1200 blocks missing in the log" in "\n".join(came.in_words())
    assert came.page().count("\n| ") == 4
    assert strict_json(came)["memory"][0]["role"] == "recorder"


def test_a_complete_soak_without_a_loss_is_good(tmp_path: Path) -> None:
    came = soaked(tmp_path, thin_out=True)
    assert came.good
    assert not came._replace(interrupted=True).good
    assert [path.name for path in sorted(tmp_path.glob("soak*"))] == ["soak.mcap"]  # the others were judged and deleted


def test_damage_of_a_file_before_the_last_is_in_the_verdict(tmp_path: Path) -> None:
    came = soaked(tmp_path, damaged=True)
    assert came.verdict.checksums.damaged == ["soak-0001.mcap"]
    assert not came.good


def test_a_soak_is_judged_as_its_log_is(tmp_path: Path) -> None:
    came = soaked(tmp_path)
    whole = judge(tmp_path / "soak.mcap")
    assert came.verdict._replace(checksums=whole.checksums) == whole


def test_two_points_give_no_slope() -> None:
    assert math.isnan(soak._memory("plant", [(0.0, 1.0), (1.0, 2.0)]).slope_MB_per_h)


def test_a_process_that_has_ended_has_no_memory_figure() -> None:
    """Its number stays until its parent looks, and its memory reads 0, which would bend the slope."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)
    assert soak._resident(1.0, ended.pid) == []
    ended.wait()
    assert soak._resident(1.0, ended.pid) == []
    assert soak._resident(1.0, os.getpid())[0][1] > 1.0
