"""The certificates of a tls/ endpoint: files of each role, the day on which they end, and who can read their keys."""

import base64
import binascii
import contextlib
import datetime
import os
import re
import stat
from pathlib import Path
from typing import Any, NamedTuple

from bridge.faults import Fault

AUTHORITY = "authority"  # all roles hold its certificate; its key signs theirs and must not leave its folder
RIG = "rig"
# Time before the end of a certificate from which each session warns. Longer: warnings that are ignored. Shorter: less than a
# month to renew the files on each computer.
_WARN = datetime.timedelta(days=30)
# The validity of a certificate in DER: begin and end, as UTCTime (two digits of the year) or GeneralizedTime.
_VALIDITY = re.compile(rb"\x30[\x1e-\x22](?:\x17\x0d\d{12}|\x18\x0f\d{14})Z(?:\x17\x0d(\d{12})|\x18\x0f(\d{14}))Z")
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
    """The files of a role. Raises Fault NOT_SECURE if a file is missing or has expired, or if others can read the key."""
    files = files_of(role, place)
    for path in files:
        if not path.is_file():
            line = f"{path}: no such file: role {role} needs it at a tls/ endpoint"
            raise Fault(
                "NOT_SECURE",
                f"{line}; `stickslip certs FOLDER` makes it once; copy it here, name its folder with --certs",
            )
    if files.key.stat().st_mode & (stat.S_IRWXG | stat.S_IRWXO):
        raise Fault(
            "NOT_SECURE", f"{files.key}: others can read this key: its mode must be 0600; chmod 600 {files.key}"
        )
    for path, end in ends_of(role, place):
        if end < _now():
            line = f"{path}: this certificate expired on {end:%Y-%m-%d}: no session accepts it"
            raise Fault("NOT_SECURE", f"{line}; {_renew(path)}")
    return files


def ends_of(role: str, place: Path) -> list[tuple[Path, datetime.datetime]]:
    """The readable certificates that a role needs, each with its end."""
    files = files_of(role, place)
    return [(path, end) for path in (files.authority, files.certificate) if (end := _end(path)) is not None]


def expiring(ends: list[tuple[Path, datetime.datetime]]) -> str:
    """The certificates that end within 30 days, as text; empty if none does."""
    return "; ".join(
        f"{path}: this certificate {'expires' if end > _now() else 'expired'} on {end:%Y-%m-%d}; {_renew(path)}"
        for path, end in ends
        if end < _now() + _WARN
    )


def _renew(path: Path) -> str:
    if path.stem == AUTHORITY:
        return "make a new authority and all roles with `stickslip certs NEW_FOLDER`"
    return f"in the folder with {AUTHORITY}.key delete the files of all roles, and run `stickslip certs FOLDER` again"


def _end(path: Path) -> datetime.datetime | None:
    """The end of a certificate; None if it cannot be read, which Zenoh reports. `cryptography` would delay a stop by 0.13 s."""
    with contextlib.suppress(OSError, ValueError, IndexError, binascii.Error):
        pem = path.read_bytes().partition(b"-----BEGIN CERTIFICATE-----")[2].partition(b"-----END")[0]
        if (match := _VALIDITY.search(base64.b64decode(pem))) is not None:
            short, long = match.groups()
            text, form = (long, "%Y%m%d%H%M%S") if long else (short, "%y%m%d%H%M%S")
            return datetime.datetime.strptime(text.decode(), form).replace(tzinfo=datetime.UTC)
    return None


def _now() -> datetime.datetime:
    return datetime.datetime.now(datetime.UTC)


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
