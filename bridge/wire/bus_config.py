"""Endpoint and key prefix of the bus of one rig, and whether only this computer can reach the endpoint."""

import contextlib
import ipaddress
import socket
from typing import Annotated

from pydantic import Field, field_validator, model_validator

from bridge.config import Strict


class BusConfig(Strict):
    """Address and key prefix of the bus of one rig, and the folder of the certificates."""

    endpoint: Annotated[str, Field(pattern=r"^(tcp|tls)/[^\s,?/]+:[0-9]{1,5}$")] = "tcp/127.0.0.1:7447"
    prefix: Annotated[str, Field(pattern=r"^[^/*$?#]+(/[^/*$?#]+)*$")] = "rig"
    certificates: str = Field(
        default="",
        description="Folder that `stickslip certs` made, for tls/ endpoints; empty: ~/.config/stickslip/certificates.",
    )
    insecure: bool = Field(
        default=False,
        description="true: a tcp/ endpoint needs no password, and other computers may reach it. Never on a shared network.",
    )
    wait_s: float = Field(
        default=30.0,
        gt=0.0,
        le=1e6,
        description="Longest wait of plant, controller and recorder for each other at the start; `stickslip run` has --wait.",
    )

    @property
    def port(self) -> int:
        """The port of the endpoint."""
        return int(self.endpoint.rpartition(":")[2])

    @property
    def encrypted(self) -> bool:
        """Whether the endpoint uses TLS."""
        return self.endpoint.startswith("tls/")

    @property
    def must_be(self) -> str:
        """A rule for messages, completed by `of a running rig`; over TLS a rig of another authority closes the link silently."""
        return "--endpoint and the authority of --certs must be those" if self.encrypted else "--endpoint must be that"

    @field_validator("endpoint")
    @classmethod
    def _port_exists(cls, endpoint: str) -> str:
        if not 1 <= int(endpoint.rpartition(":")[2]) <= 65535:
            raise ValueError(f"{endpoint!r}: the port must be from 1 to 65535; choose another, for example 7447")
        return endpoint

    @model_validator(mode="after")
    def _certificates_are_used(self) -> "BusConfig":
        if self.certificates and not self.encrypted:
            raise ValueError(
                f"certificates = {self.certificates!r}: unused at {self.endpoint!r}: the endpoint must begin with "
                "tls/; use --endpoint tls/HOST:PORT, or leave --certs out"
            )
        return self


def address(endpoint: str) -> str:
    """The numeric address of an endpoint, IPv4 if the name has one; empty for an unknown name."""
    host = endpoint.partition("/")[2].rpartition(":")[0].strip("[]")
    try:
        rows = socket.getaddrinfo(host, None, type=socket.SOCK_STREAM)
    except (OSError, UnicodeError):
        return ""
    addresses = [str(row[4][0]) for row in rows if row[0] in {socket.AF_INET, socket.AF_INET6}]
    return min(addresses, key=lambda text: ":" in text, default="")


def is_loopback(endpoint: str) -> bool:
    """Whether only this computer can reach an endpoint; False for a name that cannot be resolved."""
    number = address(endpoint).partition("%")[0]
    return bool(number) and ipaddress.ip_address(number).is_loopback


def is_free(endpoint: str) -> bool:
    """Whether an endpoint is of this computer alone and no process listens there. Connects nothing, which a rig counts."""
    number, port = address(endpoint), endpoint.rpartition(":")[2]
    if not is_loopback(endpoint):
        return False
    with socket.socket(socket.AF_INET6 if ":" in number else socket.AF_INET, socket.SOCK_STREAM) as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)  # does not disturb a rig that begins to listen
        with contextlib.suppress(OSError):
            probe.bind((number, int(port)))
            return True
    return False
