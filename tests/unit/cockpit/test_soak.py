"""What a soak makes of what it hears."""

import math
import os
import subprocess
import sys

import pytest

from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import APPLIED as LAYOUT
from bridge.wire.topics import APPLIED, RECORDER_EVENT
from cockpit.run import soak
from cockpit.run.soak import Soaked
from tests.system.ports import free_endpoint


def heard(numbers: list[int], gap: bool = False, interrupted: bool = False) -> Soaked:
    watch = soak._Watch(soak.BusConfig(endpoint=free_endpoint()), 20.0, lambda _share: None)
    for number in numbers:
        applied = LAYOUT.blank()
        applied["sequence"], applied["t_ns"] = number, (number + 1) * 10_000_000
        applied["commands"], applied["round_trip_ns"] = 1, 300_000 if number % 100 else 2_000_000
        watch._take(APPLIED.name, applied.tobytes())
    if gap:
        event = wire.Event(source="recorder", code="GAP", text="/sensors: 3 lost before 705")
        watch._take(RECORDER_EVENT.name, event.SerializeToString())
    watch._take(RECORDER_EVENT.name, wire.Event(source="recorder", code="WATCH").SerializeToString())
    watch._memory["recorder"] = [(t_s, 100.0 + 2.0 * t_s / 3600.0) for t_s in range(20)]
    return watch.result("belt", interrupted)


def test_lost_blocks_latency_and_memory_are_told() -> None:
    soaked = heard([*range(700), *range(705, 2000)], gap=True)
    assert soaked.unheard == 5
    assert (soaked.blocks, soaked.lost_blocks, soaked.good) == (1995, 3, False)
    assert [(one.unheard, one.late) for one in soaked.periods] == [(5, 9), (0, 10)]
    assert soaked.periods[0].p50_us == 300.0
    assert soaked.periods[0].max_us == 2000.0
    assert soaked.events == {"GAP": 1}
    (memory,) = soaked.memory
    assert memory.role == "recorder"
    assert memory.slope_MB_per_h == pytest.approx(2.0)
    assert "3 LOST" in "\n".join(soaked.in_words())
    assert soaked.page().count("\n| ") == 3


def test_what_ran_to_its_end_without_a_loss_is_good() -> None:
    assert heard(list(range(2000))).good
    assert not heard(list(range(2000)), interrupted=True).good


def test_two_points_are_no_slope() -> None:
    assert math.isnan(soak._memory("plant", [(0.0, 1.0), (1.0, 2.0)]).slope_MB_per_h)


def test_a_process_that_has_ended_tells_no_memory() -> None:
    """Its number stays until its parent looks, and its memory reads 0, which would bend the slope."""
    ended = subprocess.Popen([sys.executable, "-c", ""])
    os.waitid(os.P_PID, ended.pid, os.WEXITED | os.WNOWAIT)
    assert soak._resident(1.0, ended.pid) == []
    ended.wait()
    assert soak._resident(1.0, ended.pid) == []
    assert soak._resident(1.0, os.getpid())[0][1] > 1.0
