"""The drive velocity from a measured position: constant between changes of speed, measured during slow changes."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from diagnosis.evidence.folder import MeasuredRun
from diagnosis.features.segments import commands_of
from diagnosis.report import assemble
from tests.prepared import prepared

BLOCKS = 6000


@pytest.fixture(scope="module")
def rig():
    evidence, _ = prepared("ladder")
    return evidence.rig


def velocity_mps(ramp_s: float) -> np.ndarray:
    """From rest to 2 mm/s, at 3 s on to -0.5 mm/s, at an even rate for `ramp_s` each [BLOCKS]."""
    t_s = (np.arange(BLOCKS) + 0.5) * 1e-3
    if ramp_s == 0.0:
        return np.where(t_s < 3.0, 2e-3, -0.5e-3)
    return 2e-3 * np.clip(t_s / ramp_s, 0.0, 1.0) - 2.5e-3 * np.clip((t_s - 3.0) / ramp_s, 0.0, 1.0)


def read(rig, moved_mps: np.ndarray, stated_mps: float | None = None):
    """The commands of a run whose drive moves like this, its position within 0.3 um."""
    noise_m = 0.3e-6 * np.random.default_rng(1).standard_normal(BLOCKS)
    position_m = np.cumsum(moved_mps) * 1e-3 + noise_m
    t_s = (np.arange(BLOCKS) + 0.5) * 1e-3
    run = MeasuredRun("run-01.csv", t_s, {"drive_position_m": position_m}, {}, stated_mps, False)
    return commands_of(run, rig, {"drive_position_m": position_m})


@pytest.mark.parametrize("ramp_s", [0.0, 0.05, 0.3, 1.0])
@pytest.mark.slow
def test_segments_are_even_and_the_way_between_is_as_measured(rig, ramp_s):
    true_mps = velocity_mps(ramp_s)
    commands_read = read(rig, true_mps)
    assert [segment.drive_velocity_mps for segment in commands_read.segments] == pytest.approx(
        [2e-3, -0.5e-3], rel=2e-3
    )
    for segment in commands_read.segments:
        # a tenth of the change may lie in the segment's last window
        assert np.ptp(true_mps[segment.first : segment.last - 100]) < 1e-9
    apart_m = np.abs(np.cumsum(commands_read.drive - true_mps)) * 1e-3
    # a change of 50 ms is a step at its middle, the start one at once
    assert apart_m.max() < (70e-6 if ramp_s == 0.05 else 30e-6)


def test_a_stated_velocity_is_reached_as_measured(rig):
    true_mps = 2e-3 * np.clip((np.arange(BLOCKS) + 0.5) / 500.0, 0.0, 1.0)
    commands_read = read(rig, true_mps, stated_mps=2e-3)
    assert commands_read.drive[600:] == pytest.approx(2e-3, rel=1e-12)
    assert np.abs(np.cumsum(commands_read.drive - true_mps)).max() * 1e-3 < 30e-6
    assert commands_read.segments[0].first > 400


def test_a_ripple_is_not_read_as_a_command(rig):
    turns = 2.0 * np.pi * np.arange(BLOCKS) * 1e-3
    for frequency_Hz in (0.5, 3.0):
        commands_read = read(rig, 1e-3 * (1.0 + 0.3 * np.sin(frequency_Hz * turns)))
        assert len(commands_read.segments) == 1
        assert np.ptp(commands_read.drive) == 0.0


@pytest.mark.parametrize("noise_m", [0.0, 0.5e-6])
@pytest.mark.parametrize("zero_m", [0.0, 0.0123])
def test_a_stop_has_no_velocity(rig, noise_m, zero_m):
    """Dragged for 3 s and held for 3 s, and held all along."""
    random = np.random.default_rng(2)
    for speed_mps, segments in ((1e-3, [1e-3, 0.0]), (0.0, [0.0])):
        position_m = zero_m + speed_mps * np.minimum(np.arange(BLOCKS) * 1e-3, 3.0)
        position_m = position_m + noise_m * random.standard_normal(BLOCKS)
        run = MeasuredRun("run-01.csv", np.arange(BLOCKS) * 1e-3, {"drive_position_m": position_m}, {}, None, False)
        commands_read = commands_of(run, rig, {"drive_position_m": position_m}).segments
        assert [one.drive_velocity_mps for one in commands_read] == pytest.approx(segments, rel=2e-3, abs=0.0)


def test_changing_commands_are_counted(rig):
    steady = read(rig, velocity_mps(0.0))
    assert steady.changing_s == pytest.approx(0.0, abs=0.2)
    t_s = (np.arange(BLOCKS) + 0.5) * 1e-3
    sweep = {
        "vibration_frequency_Hz": np.where(t_s < 4.0, 1000.0 + 100.0 * t_s, 0.0),
        "vibration_amplitude_m": np.full(BLOCKS, 1e-8),
    }
    position_m = 1e-3 * t_s
    run = MeasuredRun("run-01.csv", t_s, {"drive_position_m": position_m, **sweep}, {}, 1e-3, False)
    commands_read = commands_of(run, rig, {"drive_position_m": position_m})
    assert commands_read.changing_s == pytest.approx(4.0, abs=0.01)
    assert len(commands_read.segments) == 1
    prepared_runs: Any = [
        SimpleNamespace(file="a.csv", commands=steady),
        SimpleNamespace(file="b.csv", commands=commands_read),
    ]
    (finding,) = assemble._changing(prepared_runs)
    assert finding.in_words().startswith(
        "changing         b.csv: commands: in 4 of 6 s speed or vibration change within 0.3 s"
    )
