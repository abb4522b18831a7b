"""A sampler and a function generator as one rig: the controller holds the vibration although each line takes 30 ms."""

from pathlib import Path

import numpy as np
import pytest

from bridge.wire import stickslip_pb2 as wire
from tests.closed_loop.in_box import run_in_box
from tests.system.test_rig import rows, separate
from tests.unit.bridge.rig.boxes import boxed, table

BLOCK_S = 2e-3
CHECKED_S, SETTLED_S, HELD_S = 1.8, 2.0, 1.0  # of the loop check, of the controller, of the judged time


@pytest.mark.nightly
@pytest.mark.slow
def test_the_loop_holds_behind_a_generator_that_takes_30_ms_a_line(tmp_path: Path) -> None:
    record = tmp_path / "truth.csv"
    box, exciter = separate(0.03)
    settings = [f"solver.block_s={BLOCK_S}", "solver.samples_per_block=20"]
    with boxed(tmp_path, record=str(record), settings=settings, **box) as port:
        converter = {"sample_rate_Hz": 10_000.0, "samples_per_block": 20}
        device = {"address": f"127.0.0.1:{port}", "waits": True}
        rig = table(device=device, exciter=exciter | {"frequency_max_Hz": 4000.0}, converter=converter)
        made = run_in_box(tmp_path, rig, CHECKED_S + SETTLED_S + HELD_S)
    assert made.armed * BLOCK_S < CHECKED_S
    assert made.states[-1] == wire.ACTIVE
    truth = np.array(rows(record))
    held = truth[made.armed + round(SETTLED_S / BLOCK_S) : len(made.states)]
    ratio = held[:, 1] / held[:, 2]
    assert len(held) * BLOCK_S > 0.9 * HELD_S
    assert np.abs(held[:, 3]).max() < 0.01  # a slip reaches 0.022 m/s
    assert np.mean((ratio > 1.02) & (ratio < 1.5)) > 0.99
    assert made.applied_m[-1] == pytest.approx(held[-1, 5], rel=0.05)
    assert truth[len(made.states) :, 1].tolist()[-1:] in ([], [0.0])
