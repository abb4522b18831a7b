"""A link that ends does not block its process."""

import os
import socket
from typing import Any

import pytest

from bridge.wire import loopback_users, zenoh_link
from bridge.wire.zenoh_link import Bus, BusConfig
from tests.patience import PATIENCE_S
from tests.system.ports import free_endpoint


def lingering() -> list[int]:
    """The sockets of this process whose closing waits for the other side."""
    counts: list[int] = []
    for name in os.listdir("/proc/self/fd"):
        try:
            link = socket.socket(fileno=int(name))
        except OSError:
            continue
        if link.getsockopt(socket.SOL_SOCKET, socket.SO_LINGER):
            counts.append(link.fileno())
        link.detach()
    return counts


def test_no_link_of_a_rig_or_its_viewer_waits_for_the_other_side_when_it_is_closed() -> None:
    """Else a viewer that is frozen costs the loop 30 to 40 blocks when its link is closed."""
    config = BusConfig(endpoint=free_endpoint())
    with Bus(config, "plant", lockstep=False) as plant, Bus(config, "viewer", lockstep=False) as viewer:
        plant.announce()
        assert not viewer.wait_for(["plant"], PATIENCE_S)
        for _ in range(100):
            if not lingering():
                break
            viewer.wait_for(["recorder"], 0.02)  # no recorder answers within this time
        assert lingering() == []


def test_a_running_rig_makes_its_removed_password_file_again() -> None:
    config = BusConfig(endpoint=free_endpoint())
    with Bus(config, "plant", lockstep=False) as plant:
        users = loopback_users.make(config.endpoint)
        before = users.read_text()
        users.unlink()
        for _ in range(100):
            if users.exists():
                break
            plant.wait_for(["recorder"], 0.05)  # no recorder answers within this time
        assert users.read_text() == before


def test_a_link_made_without_a_free_file_ends_no_thread(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse(_path: str) -> list[str]:
        raise OSError(24, "Too many open files")

    event: Any = None
    with monkeypatch.context() as patch:
        patch.setattr(os, "listdir", refuse)
        zenoh_link._on_link(event)
