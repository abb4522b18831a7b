"""Faults in front of a device's exciter: the delivered and the reported amplitude. The plant's own are in `tests/unit/plant`."""

import pytest

from bridge.rig.faults.exciter import SpoiledExciter
from bridge.rig.faults.schedule import Faults
from bridge.rig.faults.table import FaultTable
from tests.unit.bridge.rig.test_node import STEP_S, Bench, Rig

ORDER_M, TONE_HZ = 2e-8, 5000.0


@pytest.mark.parametrize(
    ("kind", "value", "delivered_m", "executed_m"),
    [
        ("weak", 0.5, 1e-8, 2e-8),
        ("weak", 2.0, 4e-8, 2e-8),
        ("dead", None, 0.0, 2e-8),
        ("clipping", 1.2e-8, 1.2e-8, 1.2e-8),
        ("hot", 0.5, 1.3679e-8, 2e-8),
        ("resonant", 5000.0, 2e-7, 2e-8),
        ("slow", 1e-6, 1e-9, 1e-9),
    ],
)
def test_it_delivers_otherwise_than_it_reports(
    kind: str, value: float | None, delivered_m: float, executed_m: float
) -> None:
    exciter = SpoiledExciter(STEP_S)
    exciter.set([(FaultTable(kind=kind, target="exciter", value=value), 1.0)])
    assert exciter.delivered_m(TONE_HZ, ORDER_M) == pytest.approx(delivered_m, rel=1e-4)
    assert exciter.executed_m == pytest.approx(executed_m)
    exciter.set([])
    assert exciter.delivered_m(TONE_HZ, ORDER_M) == ORDER_M
    assert exciter.executed_m is None


def test_a_device_gets_the_delivered_amplitude_and_the_rig_reports_the_executed_one() -> None:
    rig = Rig(Bench())
    exciter = SpoiledExciter(STEP_S)
    rig.node._exciter = exciter
    weak = FaultTable(kind="weak", target="exciter", value=0.25, from_s=0.1)
    rig.node.faults = Faults([weak], 1, STEP_S, 20, exciter.set)
    rig.run(200)
    assert rig.applied_m[-1] == pytest.approx(3e-8, rel=1e-3)
    assert rig.device.orders[-1][1] == pytest.approx(0.25 * rig.applied_m[-1])
