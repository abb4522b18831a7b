"""Cores, pauses and the threads of the bus."""

import os
import threading
import time

import pytest

from bridge.wire import realtime
from bridge.wire.topics import SENSORS
from bridge.wire.zenoh_link import Bus, BusConfig, Received
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint


def test_cores_are_those_that_the_process_may_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(os, "sched_getaffinity", lambda _process: {5, 3})
    assert [realtime.core(place) for place in range(4)] == [3, 5, 3, 5]


def test_pinning_keeps_every_thread_on_the_core() -> None:
    go_on, found = threading.Event(), list[set[int]]()

    def look() -> None:
        go_on.wait(PATIENCE_S)
        found.append(os.sched_getaffinity(0))

    cores, other = os.sched_getaffinity(0), threading.Thread(target=look)
    other.start()
    try:
        core = realtime.core(1)
        assert core is not None
        assert realtime.pin(core)
        assert os.sched_getaffinity(0) == {core}
    finally:
        go_on.set()
        other.join()
        os.sched_setaffinity(0, cores)
    assert found == [{core}]


def test_a_wait_that_ended_in_time_was_no_pause() -> None:
    now_s = time.monotonic()
    assert not realtime.was_paused(now_s, now_s + 0.05)
    assert not realtime.was_paused(now_s, now_s - 3.0)  # the deadline was already past: the process did not stall
    assert realtime.was_paused(now_s - 3.0, now_s - 2.9)


def test_a_thread_of_the_bus_keeps_its_state_from_message_to_message() -> None:
    config, of_thread = BusConfig(endpoint=free_endpoint()), threading.local()
    came = threading.Semaphore(0)
    states = list[int]()

    def receive(_received: Received) -> None:
        if not hasattr(of_thread, "known"):
            of_thread.known = True
            states.append(threading.get_native_id())
        came.release()

    with Bus(config, "plant", lockstep=True) as plant, Bus(config, "controller", lockstep=True) as controller:
        controller.listen(SENSORS, receive)
        controller.announce()
        assert not plant.wait_for({"controller"}, PATIENCE_S)
        send = plant.publisher(SENSORS)
        for _ in range(200):
            send(b"message")
        for _ in range(200):
            assert came.acquire(timeout=PATIENCE_S)
    assert len(states) == len(set(states))  # one state a thread, not one a message
