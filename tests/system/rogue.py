"""A session without a role, or with the password of a role, that sends messages no process of the project would send."""

import json
import time
from collections.abc import Generator, Iterable
from contextlib import contextmanager
from typing import Any

import zenoh

from bridge.wire import loopback_users


@contextmanager
def rogue(endpoint: str, role: str | None = None, more: dict[str, Any] | None = None) -> Generator[zenoh.Session]:
    """A bare session, with the password of `role` where one is given. Raises zenoh.ZError where it is refused."""
    settings: dict[str, Any] = {
        "mode": "client",
        "connect/endpoints": [endpoint],
        "connect/timeout_ms": 300,
        "connect/exit_on_failure": True,
        "scouting/multicast/enabled": False,
    }
    if role is not None:
        word = loopback_users.password(endpoint, role)
        settings["transport/auth/usrpwd"] = {"user": role, "password": word}
    config = zenoh.Config()
    for key, value in (settings | (more or {})).items():
        config.insert_json5(key, json.dumps(value))
    session = zenoh.open(config)
    try:
        yield session
    finally:
        session.close()


def say(
    session: zenoh.Session, key: str, payloads: Iterable[bytes], for_s: float = 0.2, apart_s: float = 0.001
) -> None:
    """Put the payloads in turn, again and again for a while."""
    until_s = time.monotonic() + for_s
    every = list(payloads)
    while True:
        for payload in every:
            session.put(key, payload)
            time.sleep(apart_s)
        if time.monotonic() > until_s:
            return
