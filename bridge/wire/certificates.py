"""The certificates of a tls/ endpoint: files of each role, and a check that only this user can read its key."""

import os
import stat
from pathlib import Path
from typing import Any, NamedTuple

from bridge.faults import Fault

AUTHORITY = "authority"  # all roles hold its certificate; its key signs theirs and must not leave its folder
RIG = "rig"
CLUSTER = "cluster"  # scheduler, workers and client of a Dask cluster; no access to the bus


class RoleFiles(NamedTuple):
    """The files of one role in a folder of certificates."""

    authority: Path
    certificate: Path
    key: Path


def folder(given: str) -> Path:
    """The folder of the certificates; by default in the configuration folder of the user."""
    if given:
        return Path(given).expanduser()
    home = os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config")
    return Path(home) / "stickslip" / "certificates"


def files_of(role: str, place: Path) -> RoleFiles:
    """The files of a role, by name."""
    return RoleFiles(place / f"{AUTHORITY}.pem", place / f"{role}.pem", place / f"{role}.key")


def checked(role: str, place: Path) -> RoleFiles:
    """The files of a role. Raises Fault NOT_SECURE if a file is missing, or if others can read the key."""
    files = files_of(role, place)
    for path in files:
        if not path.is_file():
            line = f"{path}: no such file: role {role} needs it at a tls/ endpoint"
            raise Fault(
                "NOT_SECURE", f"{line}; make it with `stickslip certs FOLDER`, and name the folder with --certs"
            )
    if files.key.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise Fault(
            "NOT_SECURE", f"{files.key}: others can read this key: its mode must be 0600; chmod 600 {files.key}"
        )
    return files


def tls_settings(role: str, files: RoleFiles) -> dict[str, Any]:
    """Zenoh's settings of a session at a tls/ endpoint; role `rig` listens."""
    side = "listen" if role == RIG else "connect"
    return {
        "transport/link/tls/root_ca_certificate": str(files.authority),
        "transport/link/tls/enable_mtls": True,
        f"transport/link/tls/{side}_certificate": str(files.certificate),
        f"transport/link/tls/{side}_private_key": str(files.key),
        "transport/link/tls/verify_name_on_connect": True,
        "transport/link/tls/close_link_on_expiration": False,
    }
