"""Effects of each kind of fault on samples, exciter numbers, times and messages in transit."""

import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.config import validate
from bridge.faults import Fault
from bridge.rig.faults.exciter import FIELDS
from bridge.rig.faults.kinds import KINDS, SENSORS, group_of
from bridge.rig.faults.line import Message
from bridge.rig.faults.schedule import BEGAN, ENDED, Faults
from bridge.rig.faults.table import FaultTable
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import sensor_block
from plant.config import RigConfig
from plant.records import build
from plant.rig.exciter_faults import ExciterFaults

SAMPLES, BLOCK_S = 20, 1e-3
RAMP = np.arange(SAMPLES) + 1.0


def table(kind: str, target: str, **more: Any) -> FaultTable:
    return validate(FaultTable, {"kind": kind, "target": target} | more, "scenario.toml")


def faults(*tables: FaultTable, seed: int = 1) -> Faults:
    params, _ = build(validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063"}}, "rig"))
    return Faults(tables, seed, BLOCK_S, SAMPLES, ExciterFaults(params[0]).set)


def blocks(made: Faults, count: int, channel: str = "drive_force_N") -> Any:
    """Samples of a channel that rises by 1 from sample to sample, and is 100 times as large in the other channels."""
    shown: list[Any] = []
    for block in range(count):
        sensors = sensor_block(SAMPLES).blank()
        for name in CHANNELS:
            sensors[name][0] = (RAMP + block * SAMPLES) * (1.0 if name == channel else 100.0)
        made.begin_block(block)
        made.spoil(sensors, block)
        shown.append(sensors[channel][0].copy())
    return np.concatenate(shown)


CLEAN = np.arange(10 * SAMPLES) + 1.0


@pytest.mark.parametrize(
    ("kind", "more", "expected"),
    [
        ("off", {}, np.zeros(SAMPLES)),
        ("off", {"value": 4.0}, np.full(SAMPLES, 4.0)),
        ("stuck", {}, np.full(SAMPLES, 80.0)),
        ("frozen", {}, CLEAN[60:80]),
        ("scaled", {"value": -0.5}, -0.5 * CLEAN[80:100]),
        ("offset", {"value": 3.0}, 3.0 + CLEAN[80:100]),
        ("delayed", {"value": 1e-3}, np.full(SAMPLES, 80.0)),
        ("clipped", {"value": 90.0}, np.minimum(CLEAN[80:100], 90.0)),
        ("nan", {}, np.full(SAMPLES, math.nan)),
        ("swapped", {"other": "mass_accel_mps2"}, 100.0 * CLEAN[80:100]),
        ("drifting", {"value": 1000.0}, CLEAN[80:100] + 0.05 * np.arange(SAMPLES)),
        ("fading", {"value": -100.0}, CLEAN[80:100]),
        ("jumping", {"value": 7.0}, CLEAN[80:100] + 7.0),
        ("coarse", {"value": 50.0}, np.round(CLEAN[80:100] / 50.0) * 50.0),
        ("hum", {"value": 0.0}, CLEAN[80:100]),
        ("loose", {"value": 0.0}, CLEAN[80:100]),
    ],
)
def test_a_sensor_fails_from_its_block_on(kind: str, more: dict[str, Any], expected: Any) -> None:
    shown = blocks(faults(table(kind, "drive_force_N", from_s=0.004, **more)), 5)
    np.testing.assert_array_equal(shown[:80], CLEAN[:80])
    np.testing.assert_allclose(shown[80:], expected, rtol=1e-6)


def test_delayed_messages_arrive_in_order() -> None:
    shown = blocks(faults(table("delayed", "drive_force_N", from_s=0.004, value=1.5e-3)), 8)
    np.testing.assert_array_equal(shown[110:], CLEAN[80:130])
    assert set(shown[80:110]) == {80.0}


def test_a_gain_fades_and_stays_above_0() -> None:
    shown = blocks(faults(table("fading", "drive_force_N", value=-500.0)), 4)
    np.testing.assert_allclose(shown[20:40], 0.5 * CLEAN[20:40], rtol=1e-6)
    np.testing.assert_array_equal(shown[40:], np.zeros(40))


def test_one_sample_is_huge_and_garbage_stays_within_its_value() -> None:
    shown = blocks(faults(table("huge", "drive_force_N")), 1)
    assert np.count_nonzero(shown > 1e38) == 1
    shown = blocks(faults(table("garbage", "drive_force_N", value=2.0)), 10)
    assert 1.5 < np.abs(shown).max() <= 2.0


def test_lost_counts_add_up_every_10_ms() -> None:
    added = blocks(faults(table("slipping", "drive_force_N", value=7.0)), 25) - np.arange(25 * SAMPLES) - 1.0
    assert (added[5], added[150], added[450]) == (7.0, 7.0, 21.0)


def test_bursts_take_3_of_37_ms_and_stay_within_their_value() -> None:
    added = blocks(faults(table("bursts", "drive_force_N", value=7.0)), 74) - np.arange(74 * SAMPLES) - 1.0
    assert np.count_nonzero(added) == pytest.approx(2 * 3 * SAMPLES, abs=2)
    assert np.abs(added).max() == pytest.approx(7.0, rel=0.1)


def test_a_charge_amplifier_loses_a_constant_signal() -> None:
    made = faults(table("charge", "base_accel_mps2", value=0.01))
    sensors, last = sensor_block(SAMPLES).blank(), []
    for block in range(21):
        sensors["base_accel_mps2"][0] = 50.0
        made.begin_block(block)
        made.spoil(sensors, block)
        last.append(float(sensors["base_accel_mps2"][0, -1]))
    assert last[0] == pytest.approx(50.0 * math.exp(-0.1), rel=0.02)
    assert last[20] == pytest.approx(50.0 * math.exp(-2.1), rel=0.02)


def test_an_exciter_chatters_for_80_ms_of_every_second() -> None:
    params, _ = build(validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063"}}, "rig"))
    made = Faults([table("chattering", "exciter", value=2.0)], 1, BLOCK_S, SAMPLES, ExciterFaults(params[0]).set)
    delivered = []
    for block in range(1100):
        made.begin_block(block)
        delivered.append(float(params["delivered_ratio"][0]))
    assert [block for block in range(1, 1100) if delivered[block] != delivered[block - 1]] == [80, 1000, 1080]
    assert delivered[0] == 2.0 * delivered[500]


def test_a_loose_plug_is_off_for_its_share_of_the_time() -> None:
    shown = blocks(faults(table("loose", "drive_force_N", value=0.3)), 4000)
    assert 0.2 < np.count_nonzero(shown == 0.0) / len(shown) < 0.4


def test_the_same_seed_gives_the_same_noise_and_another_does_not() -> None:
    noisy = table("noise", "drive_force_N", value=1.0)
    first, again, other = (blocks(faults(noisy, seed=seed), 3) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    assert (first != other).all()


def test_a_fault_of_all_sensors_takes_each_channel() -> None:
    sensors = sensor_block(SAMPLES).blank()
    made = faults(table("off", "sensors", value=2.0))
    made.begin_block(0)
    made.spoil(sensors, 0)
    assert all((sensors[name][0] == 2.0).all() for name in CHANNELS)


def test_begin_and_end_are_news_once_and_the_rig_is_whole_again() -> None:
    made = faults(table("scaled", "drive_force_N", from_s=0.001, for_s=0.002, value=2.0, name="twice"))
    reported: list[tuple[str, str]] = []
    for block in range(5):
        made.begin_block(block)
        reported += made.news()
    assert reported == [(BEGAN, "twice: drive_force_N scaled 2 for 0.002 s"), (ENDED, "twice: drive_force_N scaled 2")]
    assert not made.busy


@pytest.mark.parametrize(
    ("kind", "value", "field", "factor"),
    [
        ("weak", 0.25, "delivered_ratio", 0.25),
        ("dead", None, "delivered_ratio", 0.0),
        ("clipping", 1e-9, "amplitude_max_m", 0.01),
    ],
)
def test_the_exciter_fails_and_heals(kind: str, value: float | None, field: str, factor: float) -> None:
    params, _ = build(validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063"}}, "rig"))
    healthy = [float(params[0][name]) for name in FIELDS]
    made = Faults([table(kind, "exciter", value=value, for_s=0.001)], 1, BLOCK_S, SAMPLES, ExciterFaults(params[0]).set)
    made.begin_block(0)
    assert params[0][field] == pytest.approx(factor * healthy[FIELDS.index(field)])
    made.begin_block(1)
    assert [float(params[0][name]) for name in FIELDS] == healthy
    assert not made.busy


def test_a_hot_exciter_falls_to_its_share() -> None:
    params, _ = build(validate(RigConfig, {"contact": {"pair": "C45-C45 @ 0.063"}}, "rig"))
    made = Faults([table("hot", "exciter", value=0.4)], 1, BLOCK_S, SAMPLES, ExciterFaults(params[0]).set)
    shares: list[float] = []
    for block in (0, 1000, 20_000):
        made.begin_block(block)
        shares.append(float(params[0]["delivered_ratio"]))
    assert shares == pytest.approx([1.0, 0.4 + 0.6 / math.e, 0.4])


@pytest.mark.parametrize(
    ("kind", "value", "times_ns"),
    [
        ("jump", 0.5, [1_000_000, 502_000_000, 503_000_000, 4_000_000]),
        ("jump", -1.0, [1_000_000, 0, 0, 4_000_000]),
        ("frozen", None, [1_000_000, 2_000_000, 2_000_000, 4_000_000]),
        ("fast", 1.0, [1_000_000, 2_000_000, 4_000_000, 4_000_000]),
    ],
)
def test_the_clock_fails_and_is_right_again(kind: str, value: float | None, times_ns: list[int]) -> None:
    made = faults(table(kind, "clock", value=value, from_s=0.001, for_s=0.002))
    shown: list[int] = []
    for block in range(4):
        sensors = sensor_block(SAMPLES).blank()
        sensors["t_ns"] = (block + 1) * 1_000_000
        made.begin_block(block)
        made.misdate((sensors,), block)
        shown.append(int(sensors["t_ns"][0]))
    assert shown == times_ns


def arrivals(kind: str, count: int = 6, **more: Any) -> list[list[bytes]]:
    made = faults(table(kind, "commands", **more))
    arrived: list[list[bytes]] = []
    for block in range(count):
        made.begin_block(block)
        sent = [Message(bytes([block]))] if block < 4 else []
        arrived.append([message.payload for message in made.on_the_way("commands", sent, block)])
    return arrived


A, B, C, D = (bytes([number]) for number in range(4))


@pytest.mark.parametrize(
    ("kind", "more", "expected"),
    [
        ("dropped", {}, [[], [], [], [], [], []]),
        ("cut", {}, [[], [], [], [], [], []]),
        ("repeated", {"value": 2.0}, [[A] * 3, [B] * 3, [C] * 3, [D] * 3, [], []]),
        ("late", {"value": 0.002}, [[], [], [A], [B], [C], [D]]),
        ("reordered", {}, [[A], [], [C, B], [], [D], []]),
        ("held", {"for_s": 0.003}, [[], [], [], [A, B, C, D], [], []]),
        ("jittered", {"value": 0.0}, [[A], [B], [C], [D], [], []]),
        ("dropped", {"value": 0.0}, [[A], [B], [C], [D], [], []]),
    ],
)
def test_messages_on_their_way(kind: str, more: dict[str, Any], expected: list[list[bytes]]) -> None:
    assert arrivals(kind, **more) == expected


def test_a_fault_of_one_direction_leaves_the_other_and_one_of_the_link_takes_both() -> None:
    for target, through in (("commands", 1), ("link", 0)):
        made = faults(table("cut", target))
        made.begin_block(0)
        assert made.on_the_bus
        assert len(made.on_the_way("blocks", [Message(A)], 0)) == through


def test_a_share_of_the_messages_is_lost_and_corrupted_bytes_are_others() -> None:
    through = sum(len(came) for came in arrivals("dropped", 400, value=0.5))
    assert 0 <= through <= 4
    payload = wire.Command(sequence=1, block=2, frequency_Hz=3.0).SerializeToString()
    made = faults(table("corrupted", "commands"))
    made.begin_block(0)
    came = made.on_the_way("commands", [Message(payload)] * 20, 0)
    assert len(came) == 20
    assert all(one.payload != payload and 0 < len(one.payload) <= len(payload) for one in came)


def test_forged_messages_carry_another_run_and_a_far_sequence() -> None:
    made = faults(table("forged", "link"))
    made.begin_block(0)
    command = wire.Command(sequence=1, block=2, run=5, frequency_Hz=3.0).SerializeToString()
    _, forged = made.on_the_way("commands", [Message(command, "of")], 0)
    assert wire.Command.FromString(forged.payload).run != 5
    assert forged.of == "of"
    block = wire.SensorBlock(sequence=7).SerializeToString()
    _, forged = made.on_the_way("blocks", [Message(block)], 0)
    assert wire.SensorBlock.FromString(forged.payload).sequence > 1 << 39


@pytest.mark.parametrize(
    ("given", "line"),
    [
        ({"kind": "off", "target": "motor"}, "target = motor: no such target; known: drive_force_N"),
        ({"kind": "late", "target": "exciter"}, "kind = late: must fit target = exciter; known for it: weak"),
        ({"kind": "scaled", "target": "drive_force_N"}, "value: missing; add it for kind = scaled: factor"),
        ({"kind": "dead", "target": "exciter", "value": 1.0}, "value = 1: kind = dead has none; leave it out"),
        ({"kind": "nan", "target": "sensors", "value": 2.0}, "value = 2: must be 0 to 1 for kind = nan"),
        ({"kind": "swapped", "target": "drive_force_N"}, "other = '': needed for kind = swapped, and only there"),
        (
            {"kind": "swapped", "target": "drive_force_N", "other": "x"},
            "other = x: must be another channel than target",
        ),
        ({"kind": "held", "target": "blocks"}, "for_s = 0: held messages must arrive at some time; give for_s"),
        ({"kind": "frozen", "target": "controller"}, "for_s = 0: a frozen process must continue at some time"),
    ],
)
def test_an_invalid_table_is_refused_with_the_reason(given: dict[str, Any], line: str) -> None:
    with pytest.raises(Fault, match="CONFIG") as reported:
        validate(FaultTable, given, "scenario.toml")
    assert f"scenario.toml: {line}" in reported.value.line


def test_the_guide_lists_every_kind() -> None:
    guide = (Path(__file__).parents[3] / "docs/guides/inject-faults.md").read_text()
    rows = [re.findall(r"`([\w-]+)`", line) for line in guide.partition("| kinds |")[2].split("\n\n")[0].splitlines()]
    listed = {
        (group_of(target), kind) for target, *rest in filter(None, rows) for kind in rest if group_of(kind) is None
    }
    assert listed == {*KINDS}


def test_every_kind_of_a_sensor_is_made() -> None:
    for kind in KINDS.values():
        if kind.group == SENSORS:
            more = {"other": "mass_accel_mps2"} if kind.kind == "swapped" else {}
            value = {"value": 0.5} if kind.value else {}
            blocks(faults(table(kind.kind, "drive_force_N", **more, **value)), 2)
