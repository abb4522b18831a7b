"""Drawn axes with one sensor that is good, coarse or blind each: the rule before a run and a simulated rival, against the run.

`pytest -m nightly -s tests/closed_loop/test_blind_sensors.py` prints the table of docs/method/sensors.md.
"""

import math
from pathlib import Path
from random import Random

import numpy as np
import numpy.typing as npt
import pytest

from bench.control.drawn import drawn_axes
from bridge.log.damage import Damage
from bridge.log.storage.checksums import checksums_of
from bridge.wire.channels import CHANNELS
from cockpit.judge.run_judge import RunJudge
from cockpit.judge.verdict import RunVerdict
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import Scenario
from cockpit.run.sensor_needs import refuse_blind_sensors, refuse_out_of_travel
from diagnosis.slips import find_cycles, smallest_drop_N
from plant.records import TRUTH, build
from plant.simulate import held_velocity, run_blocks

Floats = npt.NDArray[np.float64]
FACTORS = {  # of the drawn value, ranges of the force of F_s
    "force_range_N": (0.2, 1.5),
    "force_lowest_N": (0.2, 1.5),
    "force_noise_N": (1.0, 3000.0),
    "force_resolution_N": (10.0, 30000.0),
    "force_bandwidth_Hz": (1e-4, 0.1),
    "position_noise_m": (1.0, 1000.0),
    "position_resolution_m": (1.0, 1000.0),
    "position_bandwidth_Hz": (1e-3, 1.0),
    "position_range_m": (0.02, 1.0),
    "accel_range_mps2": (1e-3, 1.0),
    "accel_noise_mps2": (10.0, 1e5),
    "accel_resolution_mps2": (10.0, 1e5),
    "accel_bandwidth_Hz": (0.02, 1.0),
}
SIMULATED_S = 10.0  # by the rival. More: over 1.6 s of CPU on a slow axis; less: slow axes do not slip


@pytest.mark.nightly  # `make test` has tests/unit/cockpit/test_sensor_needs.py
def test_the_rule_before_a_run_misses_no_blind_sensor(tmp_path: Path) -> None:
    random, counts = Random(7), {"rule": [0, 0], "simulated": [0, 0]}
    for number, drawn in enumerate(drawn_axes(7, 40)):
        sound = _left_alone_first(drawn.scenario())
        name = list(FACTORS)[number % len(FACTORS)]
        of = sound.rig.contact.static_force_N if name in ("force_range_N", "force_lowest_N") else 0.0
        was = getattr(sound.rig.sensors, name)
        low, high = FACTORS[name]
        factor = math.exp(random.uniform(math.log(low), math.log(high)))
        other = _with_sensor(sound, name, float(f"{factor * (math.copysign(of, was) if of else was):.3g}"))
        blind = _differs(_verdict(sound, tmp_path), _verdict(other, tmp_path))
        for rule, refused in (("rule", _is_refused(other)), ("simulated", _loses_slips(other))):
            counts[rule][0] += blind and not refused
            counts[rule][1] += refused and not blind
    print(counts)
    assert counts["rule"][0] == 0
    assert counts["rule"][1] <= 7
    assert counts["rule"][0] < counts["simulated"][0]


def _left_alone_first(scenario: Scenario) -> Scenario:
    policy = scenario.controller.policy.model_copy(update={"enabled_from_s": 0.5 * scenario.duration_s})
    controller = scenario.controller.model_copy(update={"policy": policy})
    return scenario.model_copy(update={"controller": controller, "arm": True})


def _with_sensor(scenario: Scenario, name: str, value: float) -> Scenario:
    sensors = scenario.rig.sensors.model_copy(update={name: value})
    return scenario.model_copy(update={"rig": scenario.rig.model_copy(update={"sensors": sensors})})


def _verdict(scenario: Scenario, folder: Path) -> RunVerdict:
    log = folder / "run.mcap"
    judge = RunJudge(log, {})
    run_onboard(scenario, log, {}, judge=judge)
    return judge.result(Damage(0, 0, closed=True), checksums_of(log), {})


def _differs(sound: RunVerdict, other: RunVerdict) -> bool:
    """Whether a sensor changes the verdict, or the slips before by more than a fifth."""
    slips, others = (verdict.before.slips if verdict.before else 0 for verdict in (sound, other))
    return sound.control != other.control or not 0.8 * slips - 1 <= others <= 1.25 * slips + 1


def _is_refused(scenario: Scenario) -> bool:
    try:
        refuse_blind_sensors(scenario.rig, scenario.controller, scenario.duration_s)
        refuse_out_of_travel(scenario.rig, scenario.duration_s)
    except ValueError:
        return True
    return False


def _loses_slips(scenario: Scenario) -> bool:
    """The rival: whether a range is left, or slips are lost, where the rig runs without a controller."""
    sensors, random = scenario.rig.sensors, np.random.default_rng(1)
    ideal = _with_sensor(_with_sensor(scenario, "force_bandwidth_Hz", 5000.0), "position_bandwidth_Hz", 5000.0)
    true, way = _signals(ideal)
    seen, _ = _signals(scenario)

    def sampled(row: Floats, noise: float, step: float, low: float, high: float) -> Floats:
        values = row + noise * random.standard_normal(len(row))
        return np.clip(np.floor(values / step + 0.5) * step if step > 0.0 else values, low, high)

    of_force = sensors.force_noise_N, sensors.force_resolution_N, sensors.force_lowest_N, sensors.force_range_N
    of_place = (
        *(sensors.position_noise_m, sensors.position_resolution_m),
        *(sensors.position_lowest_m, sensors.position_range_m),
    )
    pairs = [
        (true[0], sampled(seen[0], *of_force)),
        (true[4] - true[3], sampled(seen[4], *of_place) - sampled(seen[3], *of_place)),
    ]
    slips = [tuple(_slips(scenario, row, way) for row in pair) for pair in pairs]
    spare_N = 5.0 * sensors.force_noise_N + 0.02 * sensors.force_range_N
    leaves = true[0].max() > sensors.force_range_N or true[0].min() < sensors.force_lowest_N - spare_N
    shakes = float(np.abs(true[1]).max()) > sensors.accel_range_mps2
    return bool(leaves or shakes or any(n and not 0.8 * n <= found <= 1.25 * n for n, found in slips))


def _signals(scenario: Scenario) -> tuple[Floats, npt.NDArray[np.int64]]:
    rig = scenario.rig
    samples, blocks = rig.solver.samples_per_block, round(min(scenario.duration_s, SIMULATED_S) / rig.solver.block_s)
    drive_mps = held_velocity(rig)(np.arange(blocks) * rig.solver.block_s)
    signals, truth = (np.empty((len(rows), blocks * samples)) for rows in (CHANNELS, TRUTH))
    run_blocks(*build(rig), drive_mps, np.zeros(blocks), np.zeros(blocks), signals, truth)
    return signals, np.repeat(np.sign(drive_mps), samples).astype(np.int64)


def _slips(scenario: Scenario, row: Floats, way: npt.NDArray[np.int64]) -> int:
    """Falls along the strokes of the drive."""
    rig = scenario.rig
    t_s = np.arange(len(row)) * rig.solver.block_s / rig.solver.samples_per_block
    least = smallest_drop_N(t_s, row)
    period_s = 2.0 * math.pi * math.sqrt(rig.slide.mass_kg / rig.drive.stiffness_N_per_m)
    strokes = np.split(np.arange(len(row)), np.flatnonzero(np.diff(way)) + 1)
    return sum(
        find_cycles(t_s[part], way[part[0]] * row[part], least, max(0.1, 1.4 * period_s)).slips
        for part in strokes
        if way[part[0]] and len(part) >= 200
    )
