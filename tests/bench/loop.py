"""The loop in real time beside bare ping-pongs of the same minute, and lockstep beside its limit."""

import json
import multiprocessing
import socket
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import numpy as np
import zenoh

from bridge.wire import realtime
from bridge.wire.zenoh_link import BusConfig, session_config
from tests.system.ports import free_endpoint

SECONDS = 60.0
PINGS = 10_000  # 10 s at 1000 per second
PING = bytes(428)  # a SensorBlock
LOCKSTEP_SECONDS = 16.0
IN_PROCESS_SECONDS = 90.0  # the drive leaves its range later on


def _echo(kind: str, address: str) -> "subprocess.Popen[bytes]":
    return subprocess.Popen([sys.executable, "-m", "tests.bench.echo", kind, address])


def _ping_zenoh(endpoint: str, result: Any) -> None:
    round_trips_ns = np.empty(PINGS)
    with zenoh.open(session_config(BusConfig(endpoint=endpoint), hub=True, lockstep=False)) as session:
        pongs = session.declare_subscriber("bench/pong")
        ready = session.declare_subscriber("bench/ready")
        pings = session.declare_publisher("bench/ping", priority=zenoh.Priority.REAL_TIME, express=True)
        echo = _echo("zenoh", endpoint)
        ready.recv()
        time.sleep(0.5)
        realtime.claim(0)
        pacer = realtime.Pacer(1_000_000)
        for n in range(PINGS):
            pacer.wait(n)
            sent_ns = time.perf_counter_ns()
            pings.put(PING)
            pongs.recv()
            round_trips_ns[n] = time.perf_counter_ns() - sent_ns
        pings.put(b"")
        echo.wait(10)
    result.put(round_trips_ns)


def _ping_socket(path: str, result: Any) -> None:
    round_trips_ns = np.empty(PINGS)
    with socket.socket(socket.AF_UNIX) as listener:
        listener.bind(path)
        listener.listen()
        echo = _echo("socket", path)
        end, _ = listener.accept()
        with end:
            time.sleep(0.5)
            realtime.claim(0)
            pacer = realtime.Pacer(1_000_000)
            for n in range(PINGS):
                pacer.wait(n)
                sent_ns = time.perf_counter_ns()
                end.send(PING)
                end.recv(4096)
                round_trips_ns[n] = time.perf_counter_ns() - sent_ns
        echo.wait(10)
    result.put(round_trips_ns)


def _apart(work: Any, address: str) -> Any:
    """Run a ping in a process of its own: what it asks of the scheduler stays there."""
    context = multiprocessing.get_context("spawn")
    result = context.Queue()
    process = context.Process(target=work, args=(address, result))
    process.start()
    round_trips_ns = result.get(timeout=60)
    process.join()
    return round_trips_ns


def _run(log: Path, seconds: float, *more: str) -> tuple[dict[str, Any], float]:
    arguments = ["--set", f"duration_s={seconds}", "--endpoint", free_endpoint(), "--log", str(log), "--json", *more]
    started_s = time.perf_counter()
    run = subprocess.run(
        [sys.executable, "-m", "cockpit", "run", *arguments], capture_output=True, text=True, check=False, timeout=300
    )
    return json.loads(run.stdout), time.perf_counter() - started_s


def _row(name: str, round_trips_ns: Any) -> None:
    p50, p99, p999 = np.percentile(round_trips_ns, [50, 99, 99.9]) * 1e-3
    print(f"  {name:<22} p50 {p50:6.0f} us   p99 {p99:6.0f} us   p99.9 {p999:6.0f} us")


def _lockstep_seconds(log: Path) -> float:
    """Wall time of the blocks of a lockstep run alone, from the log's own file: start-up is not the loop's."""
    short, long = (_run(log, seconds, "--lockstep")[1] for seconds in (1.0, 1.0 + LOCKSTEP_SECONDS))
    return long - short


def bench() -> bool:
    """Print the tables; whether every bar is kept."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "run.mcap"
        print(
            f"\nreal time: {SECONDS:g} s at 1000 blocks/s, block out to command in, beside ping-pongs of the same minute"
        )
        pings = [_apart(_ping_zenoh, free_endpoint())]
        sockets = [_apart(_ping_socket, str(Path(folder) / "a"))]
        verdict, _ = _run(log, SECONDS, "--set", "controller.policy.enabled_from_s=0.0")
        pings.append(_apart(_ping_zenoh, free_endpoint()))
        sockets.append(_apart(_ping_socket, str(Path(folder) / "b")))
        zenoh_ns, socket_ns = np.concatenate(pings), np.concatenate(sockets)
        _row("Unix socket ping-pong", socket_ns)
        _row("Zenoh ping-pong", zenoh_ns)
        latency = verdict["latency"]
        p50_us, p99_us, p999_us = latency["p50_us"], latency["p99_us"], latency["p999_us"]
        print(f"  {'the loop':<22} p50 {p50_us:6.0f} us   p99 {p99_us:6.0f} us   p99.9 {p999_us:6.0f} us")
        ratio = p50_us / (float(np.median(zenoh_ns)) * 1e-3)
        print(
            f"  blocks {verdict['blocks']}, lost {verdict['lost_blocks']}; log messages lost {verdict['lost_messages']}"
        )
        kept = [
            _bar("p50 over Zenoh's p50", ratio, ratio <= 2.0, "at most 2"),
            _bar(
                "commands within 1 ms [%]",
                100 * latency["within_1_ms"],
                latency["within_1_ms"] >= 0.998,
                "at least 99.8",
            ),
            _bar("lost blocks", verdict["lost_blocks"], verdict["lost_blocks"] == 0, "0"),
        ]

        print(f"\nlockstep: {LOCKSTEP_SECONDS:g} simulated s, log written")
        wall_s = _lockstep_seconds(log)
        speed = LOCKSTEP_SECONDS / wall_s
        limit = 1e6 / (float(np.median(zenoh_ns)) * 1e-3) / 1000.0
        kept.append(_bar("over Zenoh [x real time]", speed, speed >= 5.0, "at least 5"))
        print(f"  {'the paced ping-pong allows':<30} {limit:8.1f}   the loop reaches {100 * speed / limit:.0f} % of it")
        _run(log, 1.0, "--in-process")  # compiles where nobody did
        short, long = (_run(log, seconds, "--in-process")[1] for seconds in (1.0, 1.0 + IN_PROCESS_SECONDS))
        alone = IN_PROCESS_SECONDS / (long - short)
        kept.append(_bar("in one process [x real time]", alone, alone >= 200.0, "at least 200"))
        return all(kept)


def _bar(name: str, value: float, good: bool, rule: str) -> bool:
    print(f"  {name:<30} {value:8.2f}   {rule:<14} {'PASS' if good else 'FAIL'}")
    return good
