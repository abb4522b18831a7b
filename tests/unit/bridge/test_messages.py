"""The records are the protobuf encoding: checked against the protobuf library."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bridge.faults import Fault
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import (
    ANNOUNCED,
    APPLIED,
    BLOCK,
    COMMAND,
    GAP,
    LATE,
    RESET,
    STALE,
    STATE,
    STOP,
    TRACE,
    Layout,
    sensor_block,
)
from bridge.wire.payloads import sequence_and_time


@pytest.mark.parametrize("layout", [COMMAND, APPLIED, TRACE, STATE, sensor_block(20), sensor_block(50)])
def test_the_protobuf_library_reads_the_content_of_a_record(layout: Layout) -> None:
    record = layout.blank()
    for n, field in enumerate(layout.message.DESCRIPTOR.fields, start=1):
        record[field.name] = n
    parsed = layout.message.FromString(record.tobytes())
    for n, field in enumerate(layout.message.DESCRIPTOR.fields, start=1):
        expected = [n] * layout.samples if field.is_repeated else n
        assert getattr(parsed, field.name) == expected
    assert parsed.SerializeToString() == record.tobytes()


@given(st.integers(0, 2**63), st.integers(-(2**62), 2**62), st.floats(0, 1e4), st.integers(0, 5))
def test_a_client_may_leave_zeros_out(sequence: int, t_ns: int, frequency_Hz: float, mode: int) -> None:
    message = wire.Command(sequence=sequence, t_ns=t_ns, frequency_Hz=frequency_Hz, mode=mode)
    record = COMMAND.read(message.SerializeToString(), "command")
    assert (record["sequence"][0], record["t_ns"][0]) == (sequence, t_ns)
    assert (record["frequency_Hz"][0], record["mode"][0]) == (frequency_Hz, mode)
    assert sequence_and_time(message.SerializeToString(), wire.Command) == (sequence, t_ns)
    assert sequence_and_time(record.tobytes(), wire.Command) == (sequence, t_ns)


def test_bad_bytes_and_wrong_lengths_are_named() -> None:
    with pytest.raises(Fault, match=r"command.*as Command"):
        COMMAND.read(b"\xff\xff\xff", "command")
    block = wire.SensorBlock(sequence=1, **{name: [0.0] * 10 for name in CHANNELS})
    with pytest.raises(Fault, match=r"drive_force_N has 10 samples: must have 20"):
        sensor_block(20).read(block.SerializeToString(), "sensors")


def test_a_copy_is_not_shared() -> None:
    first, second = COMMAND.blank(), COMMAND.blank()
    first["block"] = 5
    assert second["block"][0] == 0
    assert np.array_equal(COMMAND.read(first.tobytes(), "command"), first)


def test_the_bits_of_a_step_match_the_schema() -> None:
    assert (BLOCK, GAP, STALE, STOP, RESET, ANNOUNCED, LATE) == (1, 2, 4, 8, 16, 32, 64)
