"""Foreign messages on an open bus end no process, change no vibration, and are reported at most once a second a kind."""

import json
import signal
import subprocess
import sys
import threading
import time
from collections import Counter
from pathlib import Path

import numpy as np
import pytest
import zenoh

from bridge.faults import FAULTS
from bridge.log.logfile import read_run
from bridge.wire import stickslip_pb2 as wire
from bridge.wire.messages import sensor_block
from bridge.wire.topics import APPLIED, SENSORS
from bridge.wire.zenoh_link import Bus, BusConfig, Inbox
from tests.system.lost import lost_of
from tests.system.ports import free_endpoint
from tests.system.rogue import rogue, say
from tests.system.run_under_way import COMMAND

pytestmark = pytest.mark.realtime

RUBBISH = b"\xff" * 12
TOPICS = (
    "command", "sensors", "announce", "applied", "trace", "state", "snapshot", "operator",
    "event/plant", "event/controller", "event/recorder",
)  # fmt: skip


def command(block: int, amplitude_m: float, frequency_Hz: float = 2600.0) -> bytes:
    return wire.Command(block=block, amplitude_m=amplitude_m, frequency_Hz=frequency_Hz).SerializeToString()


def block(number: int) -> bytes:
    made = sensor_block(20).blank()
    made["sequence"], made["t_ns"] = number, min((number + 1) * 1_000_000, 2**62)
    return made.tobytes()


def attack(session: zenoh.Session, now: int) -> None:
    """Every kind of message that must do nothing; `now` is about the number of the present block."""
    for topic in TOPICS:
        say(session, f"rig/{topic}", [RUBBISH], 0.02)
    session.put("rig/sensors", b"\xff" * 3_000_000, congestion_control=zenoh.CongestionControl.BLOCK)
    say(session, "rig/operator", [b"\xff" * 3_000_000, wire.Operator().SerializeToString() + b"\x08\x07"], 0.0)
    nonsense = [command(now, float("nan")), command(now, -1.0), command(now, 1e300), command(now, 1e-8, float("inf"))]
    say(session, "rig/command", nonsense, 0.3)
    say(session, "rig/command", [command(now + 10**6, 1e-7), command(3, 1e-7)], 0.3)
    say(session, "rig/sensors", [block(2**62), block(now + 10**6), block(2**64 - 1)], 0.3)
    say(session, "rig/sensors", [block(number) for number in range(40)], 0.0)
    say(session, "rig/sensors", [block(1)], 0.1, apart_s=0.0)  # as fast as it goes
    end = wire.Event(source="plant", code="END").SerializeToString()
    say(session, "rig/event/plant", [end], 0.0)
    say(session, "rig/event/controller", [end], 0.0)
    faster = wire.Announce(holds_from_ns=0, drive_velocity_mps=1e300).SerializeToString()
    say(session, "rig/announce", [faster], 0.0)
    tokens = [session.liveliness().declare_token(f"rig/alive/{number}") for number in range(500)]
    for token in tokens:
        token.undeclare()


def test_a_foreign_sender_ends_no_process_and_changes_no_vibration(tmp_path: Path) -> None:
    log, endpoint = tmp_path / "run.mcap", free_endpoint()
    settings = ["--set", "duration_s=99", "--set", "controller.policy.enabled_from_s=0.0"]
    run = subprocess.Popen(
        [*COMMAND, "run", *settings, "--insecure", "--endpoint", endpoint, "--log", str(log), "--json"],
        stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True,
    )  # fmt: skip
    try:
        inbox = Inbox(100_000)
        with Bus(BusConfig(endpoint=endpoint), "viewer", lockstep=False, patience_s=60.0) as viewer:
            viewer.listen(APPLIED, inbox.push)
            assert not viewer.wait_for({"plant", "controller", "recorder"}, 60.0)
            while (received := inbox.get(20.0)) is not None:
                applied = wire.Applied.FromString(received.payload)
                if applied.amplitude_m > 1e-8 and applied.sequence > 1500:
                    break
            assert received is not None
            with rogue(endpoint) as session:
                attack(session, applied.sequence)
            time.sleep(1.5)
            assert not viewer.wait_for({"plant", "controller", "recorder"}, 60.0)
        run.send_signal(signal.SIGINT)
        out, err = run.communicate(timeout=60)
    finally:
        run.kill()
        run.communicate()
    assert run.returncode == FAULTS["INTERRUPTED"].exit_status, err
    assert json.loads(out)["fault"] == "INTERRUPTED"
    assert "warning" in err
    assert "--insecure: any program that reaches this port can command the exciter" in err
    data = read_run(log)
    assert len(data.sensors) > 2000
    assert data.damage.closed
    # the rig's own numbers and no others; a busy computer may lose some, and reports it
    numbers = data.sensors["sequence"].astype(np.int64)
    gaps = np.diff(numbers, prepend=-1) - 1
    assert gaps.min() >= 0
    assert gaps.sum() == lost_of(data.events)["/sensors"]
    before, after = data.applied[1000 : applied.sequence], data.applied[applied.sequence :]
    # at most the amplitude of the rig's controller, unless the computer delayed one of both
    assert after["amplitude_m"].max() <= data.trace["wanted_amplitude_m"].max()
    if not {"FALLBACK", "STALE"} & {event.code for event in data.events}:
        assert after["amplitude_m"].max() < 1.2 * before["amplitude_m"].max()
    assert after["fallback"].mean() < 0.1  # a busy computer may be late
    counts = Counter(event.code for event in data.events)
    assert {"BAD_MESSAGE", "FOREIGN"} <= set(counts)
    lasted_s = len(after) * 1e-3
    kinds = {(event.source, event.code, event.text.split(":")[0]) for event in data.events}
    assert sum(counts.values()) < len(kinds) * (lasted_s + 2.0)
    assert sum(1 for event in data.events if event.source == "controller" and event.code == "END") == 1


def test_headers_of_foreign_senders_are_ignored() -> None:
    config = BusConfig(endpoint=free_endpoint(), insecure=True)
    with Bus(config, "plant", lockstep=False) as plant, rogue(config.endpoint) as session:
        answers = {
            "rig/header/x": RUBBISH,
            "rig/header/y": wire.Header(role="plant", schema_version=9).SerializeToString(),
        }

        def reply(query: zenoh.Query) -> None:
            with query:
                key = str(query.key_expr) if "*" not in str(query.key_expr) else "rig/header/x"
                query.reply(key, answers.get(key, RUBBISH))

        kept = [session.declare_queryable(key, reply) for key in answers]
        plant.serve_header(wire.Header(role="plant", schema_version=2))
        with Bus(config, "recorder", lockstep=False) as recorder:
            headers = recorder.headers(["plant"], 5.0, threading.Event())
        assert headers["plant"].schema_version == 2
        assert len(kept) == 2


def test_a_rig_of_another_schema_is_refused() -> None:
    config = BusConfig(endpoint=free_endpoint())
    with Bus(config, "plant", lockstep=False) as plant:
        plant.serve_header(wire.Header(role="plant", schema_version=9))
        plant.announce()
        refused = subprocess.run(
            [sys.executable, "-m", "cockpit", "controller", "--endpoint", config.endpoint],
            capture_output=True, text=True, timeout=60, check=False,
        )  # fmt: skip
    assert refused.returncode == 8
    assert "BAD_MESSAGE: header/plant: schema_version = 9: must be 1 to 3" in refused.stderr


@pytest.mark.parametrize(("size", "heard"), [(100_000, (1 << 16) + 1), (5_000_000, None)])
def test_a_message_beyond_the_limit_is_not_parsed_and_blocks_no_process(size: int, heard: int | None) -> None:
    config, inbox = BusConfig(endpoint=free_endpoint(), insecure=True), Inbox(10)
    with Bus(config, "plant", lockstep=False) as plant, Bus(config, "controller", lockstep=False) as controller:
        controller.listen(SENSORS, inbox.push)
        controller.announce()
        assert not plant.wait_for({"controller"}, 5.0)
        with rogue(config.endpoint) as session:
            session.put("rig/sensors", bytes(size), congestion_control=zenoh.CongestionControl.BLOCK)
            time.sleep(0.5)
            plant.publisher(SENSORS)(b"rig")
            received = [inbox.get(5.0)] if heard is None else [inbox.get(5.0), inbox.get(5.0)]
    assert [len(message.payload) for message in received if message] == ([3] if heard is None else [heard, 3])
