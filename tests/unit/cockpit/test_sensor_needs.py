"""Sensors that cannot show the motion of a description are refused with the number to use; sound ones are taken."""

import re

import pytest

from bridge.faults import Fault
from cockpit.run.scenario import load_scenario

TO_AND_FRO = [
    "rig.drive.profile=[[0.0, 0.0], [0.1, 0.0005], [7.9, 0.0005], [8.0, 0.0], [8.1, -0.0005], [15.9, -0.0005], [16.0, 0.0]]",
    "rig.drive.repeat_every_s=16.0",
    "rig.sensors.position_lowest_m=-0.05",
]
HEAVY = [
    *("rig.slide.mass_kg=80.0", "rig.drive.stiffness_N_per_m=8e6", "rig.drive.damping_Ns_per_m=1000.0"),
    *("rig.contact.stiffness_N_per_m=1e9", "rig.contact.damping_Ns_per_m=5e5"),
    *("rig.contact.coulomb_force_N=200.0", "rig.contact.static_force_N=240.0"),
]
BLIND = {
    "force range below F_s": [*HEAVY, "rig.sensors.force_range_N=50.0"],
    "force range below F_s with effects": ["rig.effects.static-level.ratio=2.0"],
    "force range below the overshoot at break-away": [
        *HEAVY,
        "rig.sensors.force_range_N=245.0",
        "rig.drive.profile=[[0, 0.002]]",
    ],
    "force range below the viscous force": ["rig.contact.viscous_damping_Ns_per_m=1e5"],
    "force of one sign, drive of two": [*TO_AND_FRO, "rig.sensors.force_lowest_N=0.0"],
    "force backwards too small": [*TO_AND_FRO, "rig.sensors.force_lowest_N=-10.0"],
    "force noise": ["rig.sensors.force_noise_N=5.0"],
    "force resolution": ["rig.sensors.force_resolution_N=2.0"],
    "force noise that the controller doubts": ["rig.sensors.force_noise_N=1.28"],
    "force steps that count as frozen": ["rig.sensors.force_resolution_N=0.098"],
    "position steps that count as another scale": ["rig.sensors.position_resolution_m=6.1e-6"],
    "accelerometer noise that opens the loop": ["rig.sensors.accel_noise_mps2=0.77"],
    "force bandwidth": ["rig.sensors.force_bandwidth_Hz=5.0"],
    "force lag": ["rig.effects.force-sensor-lag.lag_s=0.1"],
    "travel": ["duration_s=120.0"],
    "travel of a run without an end": ["duration_s=0.0", "rig.drive.profile=[[0.0, 0.0003]]"],
    "position resolution": [*HEAVY, "rig.sensors.force_range_N=500.0", "rig.sensors.position_resolution_m=2e-5"],
    "position noise": [*HEAVY, "rig.sensors.force_range_N=500.0", "rig.sensors.position_noise_m=1e-4"],
    "position bandwidth": ["rig.sensors.position_bandwidth_Hz=2.0"],
    "drive too slow for its noise": ["rig.drive.profile=[[0.0, 1e-7]]", "rig.sensors.position_noise_m=5e-6"],
    "drive too slow for its steps": ["rig.drive.profile=[[0.0, 1e-6]]", "rig.sensors.position_resolution_m=1e-4"],
    "accelerometer range": ["rig.sensors.accel_range_mps2=10.0"],
    "accelerometer noise": ["rig.sensors.accel_noise_mps2=20.0"],
    "accelerometer resolution": ["rig.sensors.accel_resolution_mps2=10.0"],
    "accelerometer bandwidth": ["rig.sensors.accel_bandwidth_Hz=1000.0"],
    "no force sensor for the verdict": ["controller.estimator.use_force=false", "rig.sensors.force_range_N=1.0"],
    "a slip that overshoots": ["rig.contact.coulomb_force_N=4.0", "rig.sensors.force_lowest_N=-1.0"],
    "accelerometer lowest": ["rig.sensors.accel_lowest_Hz=4000.0"],
}
SOUND = {
    "range just above": [*HEAVY, "rig.sensors.force_range_N=250.0"],
    "backwards": [*TO_AND_FRO, "rig.sensors.force_lowest_N=-20.0"],
    "a short run with a small range": ["duration_s=1.0", "rig.sensors.force_range_N=8.0"],
    "noise of 1 N": ["rig.sensors.force_noise_N=1.0"],
    "steps of 5 um": ["rig.sensors.position_resolution_m=5e-6"],
    "an end before the range": ["duration_s=99.0"],
    "to and fro for ever": [*TO_AND_FRO, "duration_s=0.0", "rig.sensors.force_lowest_N=-50.0"],
    "2 g": ["rig.sensors.accel_range_mps2=19.6"],
    "a slow accelerometer that is corrected": [
        "rig.sensors.accel_bandwidth_Hz=2000.0",
        "controller.amplitude.accel_bandwidth_Hz=2000.0",
    ],
    "a sensor that a fault breaks": [
        "fault=[{kind='scaled', target='drive_force_N', value=0.0}]",
    ],
    "nothing slips, so that noise hides nothing": ['rig.file="paper-c45-ptfe"', "rig.sensors.force_noise_N=5.0"],
}

RIGS = ["paper-c45-c45", "stop-and-go", "belt-axis", "ball-screw-axis", "pneumatic-seal", "drill-string"]
COARSE = {
    setting.partition("=")[0].rpartition(".")[2]: [setting]
    for setting in (
        *("rig.sensors.force_range_N=1e-3", "rig.sensors.force_lowest_N=-1e-3", "rig.sensors.force_noise_N=1e4"),
        *("rig.sensors.force_resolution_N=1e4", "rig.sensors.force_bandwidth_Hz=1e-3"),
        *("rig.effects.force-sensor-lag.lag_s=1.0", "rig.sensors.position_range_m=1e-6"),
        *("rig.sensors.position_noise_m=1.0", "rig.sensors.position_resolution_m=1.0"),
        *("rig.sensors.position_bandwidth_Hz=1e-3", "rig.sensors.accel_range_mps2=1e-3"),
        *("rig.sensors.accel_noise_mps2=1e4", "rig.sensors.accel_resolution_mps2=1e4"),
        *("rig.sensors.accel_bandwidth_Hz=1.0", "rig.sensors.accel_lowest_Hz=1e5"),
    )
} | {
    "backwards first": [
        "rig.sensors.position_lowest_m=-1e-6",
        "rig.drive.moves=[]",
        "rig.drive.repeat_every_s=0",
        "rig.drive.profile=[[0, -0.001], [9, 0.001]]",
    ],
    "without an end": [
        "duration_s=0",
        "rig.drive.moves=[]",
        "rig.drive.repeat_every_s=0",
        "rig.drive.profile=[[0, 0.001]]",
    ],
    "noise and steps": ["rig.sensors.force_noise_N=1e4", "rig.sensors.force_resolution_N=1e4"],
}
ONE_WAY = ("paper-c45-c45", "stop-and-go", "drill-string")
EXCEPT = {"rig.sensors.force_lowest_N=-1e-3": ONE_WAY}
_ADVICE = re.compile(r"(rig\.\S+|duration_s) = \S+: .* set it to (-?[\d.e+-]+)")


@pytest.mark.parametrize("settings", BLIND.values(), ids=BLIND)
def test_a_sensor_that_cannot_see_is_refused_with_the_number(settings: list[str]) -> None:
    with pytest.raises(Fault) as caught:
        load_scenario("from-the-start", settings)
    assert caught.value.kind.code == "CONFIG"
    assert _ADVICE.search(caught.value.line), caught.value.line


@pytest.mark.parametrize("settings", SOUND.values(), ids=SOUND)
def test_a_sensor_that_sees_is_taken(settings: list[str]) -> None:
    load_scenario("from-the-start", settings)


@pytest.mark.parametrize("scenario", RIGS)
@pytest.mark.parametrize("settings", COARSE.values(), ids=COARSE)
def test_the_number_of_a_refusal_is_taken(scenario: str, settings: list[str]) -> None:
    given, refused = [*settings], set[str]()
    while line := _refusal(scenario, given):
        match = _ADVICE.search(line)
        assert match, line
        assert match[1] not in refused, line
        refused.add(match[1])
        given.append(f"{match[1]}={match[2]}")
    assert refused or scenario in EXCEPT.get(settings[0], ())


def _refusal(scenario: str, settings: list[str]) -> str:
    try:
        load_scenario(scenario, settings)
    except Fault as fault:
        return fault.line
    return ""


def test_a_refusal_names_the_value_the_need_and_the_end() -> None:
    with pytest.raises(Fault) as caught:
        load_scenario("belt-axis", ["rig.sensors.force_range_N=50"])
    line = "rig.sensors.force_range_N = 50: the drive pulls with 60.41 N, this sensor ends at 50 N; set it to 76"
    assert caught.value.line.endswith(line)


def test_the_time_at_which_a_drive_leaves_its_range_is_in_the_line() -> None:
    with pytest.raises(Fault, match=r"after 166\.7 s: .* set it to 160"):
        load_scenario("from-the-start", BLIND["travel of a run without an end"])
