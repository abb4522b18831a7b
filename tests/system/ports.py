"""A free endpoint on loopback."""

import socket


def free_endpoint() -> str:
    """An endpoint without a listener."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return f"tcp/127.0.0.1:{probe.getsockname()[1]}"
