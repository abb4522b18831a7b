"""The limits of a rig, from its header: taken where the controller gives none, and never exceeded."""

import json
from typing import Any

import pytest

from bridge.config import validate
from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.payloads import SCHEMA_VERSION
from controller.config import ControllerConfig
from controller.records import build
from controller.rig_header import for_rig, refuse_another_rig

LIMITS = {
    "amplitude_max_m": 5e-8, "velocity_max_mps": None, "slew_m_per_s": 2e-6,
    "frequency_min_Hz": 600, "frequency_max_Hz": 4000.0, "forbidden_Hz": [[3000.0, 3100.0]],
}  # fmt: skip


def header(**limits: Any) -> wire.Header:
    configuration = json.dumps({"limits": LIMITS | limits})
    return wire.Header(role="plant", schema_version=SCHEMA_VERSION, configuration=configuration)


def config(**limits: Any) -> ControllerConfig:
    return validate(ControllerConfig, {"limits": limits}, "test")


def test_limits_that_are_not_given_are_those_of_the_rig() -> None:
    taken = for_rig(header(), config(frequency_max_Hz=3500.0))
    limits = taken.limits
    assert (limits.amplitude_max_m, limits.velocity_max_mps, limits.slew_m_per_s) == (5e-8, 5e-3, 2e-6)
    assert (limits.frequency_min_Hz, limits.frequency_max_Hz) == (600.0, 3500.0)
    params = build(taken)[0][0]
    assert params["bands"] == 2
    assert params["band_Hz"][:2].tolist() == [[3000.0, 3100.0], [4600.0, 5000.0]]
    assert for_rig(header(), config(velocity_max_mps=2e-2)).limits.velocity_max_mps == 2e-2  # this rig states none
    assert for_rig(header(amplitude_max_m=4e-8), taken).limits.amplitude_max_m == 4e-8  # it is still not a given one


@pytest.mark.parametrize(
    ("given", "stated", "words"),
    [
        ({"amplitude_max_m": 1e-7}, {}, "limits.amplitude_max_m = 1e-07: must be at most 5e-08, the limit of the rig"),
        (
            {"velocity_max_mps": 2e-3},
            {"velocity_max_mps": 1e-3},
            "limits.velocity_max_mps = 0.002: must be at most 0.001",
        ),
        ({"frequency_min_Hz": 500.0}, {}, "limits.frequency_min_Hz = 500: must be at least 600, the limit of the rig"),
        ({}, {"amplitude_max_m": -1.0}, "header/plant: limits.amplitude_max_m = -1.0: Input should be greater than 0"),
        ({}, {"slew_m_per_s": "fast"}, "header/plant: limits.slew_m_per_s = 'fast': Input should be a valid number"),
        ({}, {"forbidden_Hz": [[600.0, 4000.0]]}, "limits.forbidden_Hz: no frequency is left"),
    ],
)
def test_looser_and_unreadable_limits_are_refused(given: Any, stated: Any, words: str) -> None:
    with pytest.raises(Fault) as caught:
        for_rig(header(**stated), config(**given))
    assert caught.value.kind.code == "CONFIG"
    assert words in caught.value.line
    assert ";" in caught.value.line  # the remedy follows


def test_a_restarted_rig_must_keep_its_limits() -> None:
    taken = for_rig(header(), config())
    refuse_another_rig(header(), taken)
    refuse_another_rig(None, taken)
    with pytest.raises(Fault, match="limits: differ from those before the rig was restarted"):
        refuse_another_rig(header(amplitude_max_m=4e-8), taken)
