"""Credentials of an unencrypted endpoint of this computer: a password for each role, made by the rig and read by our commands.

The file is the dictionary that Zenoh reads, `ROLE:PASSWORD` a line, in a folder that only this user can enter. A session without
a password from it is refused.
"""

import contextlib
import os
import secrets
import stat
import tempfile
from collections.abc import Callable
from pathlib import Path

from bridge.faults import Fault
from bridge.wire.bus_config import address, is_free, is_loopback

ROLES = ("controller", "recorder", "operator", "viewer")
_FOLDER = "stickslip"


def folders() -> list[Path]:
    """Folders that may hold the file, the best first: for runtime files, for the cache, for temporary files."""
    places: list[Path] = []
    if runtime := os.environ.get("XDG_RUNTIME_DIR"):
        places.append(Path(runtime) / _FOLDER)
    # not `Path.home`, which fails for a user without a home
    cache = os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache")
    if os.path.isabs(cache):
        places.append(Path(cache) / _FOLDER / "run")
    # not `tempfile.gettempdir`, which fails on a full disk: a stop must not
    places.append(Path(os.environ.get("TMPDIR") or "/tmp") / f"{_FOLDER}-{os.getuid()}")  # noqa: S108 (a private folder in it)
    return places


def file_name(endpoint: str) -> str:
    """The name of the file of an endpoint; rigs on different ports have different passwords."""
    port = endpoint.rpartition(":")[2]
    return f"{address(endpoint).replace(':', '_')}-{port}.users"


def password(endpoint: str, role: str) -> str | None:
    """The password of a role at an endpoint; None if no rig of this user has made one."""
    files = [path for path in _files(endpoint) if _is_private(path, stat.S_ISREG)]
    with contextlib.suppress(OSError, UnicodeDecodeError):
        newest = max(files, key=lambda path: path.stat().st_mtime_ns, default=None)
        for line in newest.read_text().splitlines() if newest is not None else []:
            name, _, word = line.partition(":")
            if name == role and word:
                return word
    return None


def absence(endpoint: str) -> str:
    """The reason why a rig that listens at an endpoint refuses this user: the file is missing; empty if it is not.

    A rig at a tls/ endpoint has no such file.
    """
    if (
        not endpoint.startswith("tcp/")
        or not is_loopback(endpoint)
        or is_free(endpoint)
        or password(endpoint, "viewer") is not None
    ):
        return ""
    places = ", ".join(str(folder) for folder in folders())
    return (
        f"a process listens at {endpoint}, but its password file {file_name(endpoint)} is in none of {places}: another user "
        "started it, or the folder was removed: give the command as that user, or end the rig and start it again"
    )


def make(endpoint: str, passwords: str = "") -> Path:
    """Make the file of an endpoint, or keep an existing one, so that clients stay valid over a restart of the rig.

    Args:
        endpoint: the rig's endpoint.
        passwords: content of the file; new passwords without it.

    Raises Fault NOT_SECURE if no folder is safe from other users.

    """
    problems: list[str] = []
    for path in _files(endpoint):
        try:
            path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
            if is_private_folder(path.parent):
                if not _is_whole(path):
                    _write(path, passwords or "".join(f"{role}:{secrets.token_urlsafe(24)}\n" for role in ROLES))
                os.utime(path)
                return path
            problems.append(f"{path.parent} (not private)")
        except OSError as error:
            problems.append(f"{path.parent} ({error.strerror})")
    places = ", ".join(problems)
    line = (
        f"{endpoint}: no folder can hold its password: one of {places} must belong to this user, mode 0700, with room"
    )
    raise Fault("NOT_SECURE", f"{line}; set XDG_RUNTIME_DIR to such a folder, or use a tls/ endpoint")


class KeptUsers:
    """The file of a running rig, which is removed with its folder at the user's last logout. Raises Fault NOT_SECURE."""

    def __init__(self, endpoint: str) -> None:
        self._endpoint, self._path = endpoint, make(endpoint)
        self._passwords = self._path.read_text()

    def keep(self) -> None:
        """Make the file again, with the same passwords, if it was removed. Raises Fault NOT_SECURE."""
        if not os.path.lexists(self._path):
            self._path = make(self._endpoint, self._passwords)


def _files(endpoint: str) -> list[Path]:
    return [folder / file_name(endpoint) for folder in folders()]


def is_private_folder(path: Path) -> bool:
    """Whether a folder belongs to this user, is not a link, and is closed to all others."""
    return _is_private(path, stat.S_ISDIR)


def _is_private(path: Path, is_kind: Callable[[int], bool]) -> bool:
    """Whether a path is of this kind, belongs to this user and is closed to all others; a link never is."""
    with contextlib.suppress(OSError):
        status = path.lstat()
        return is_kind(status.st_mode) and status.st_uid == os.getuid() and not status.st_mode & 0o077
    return False


def _is_whole(path: Path) -> bool:
    if not _is_private(path, stat.S_ISREG):
        return False
    known = [line.partition(":")[0] for line in path.read_text(errors="replace").splitlines()]
    return known == list(ROLES)


def _write(path: Path, passwords: str) -> None:
    """Write passwords completely or not at all; an existing file or link of the name is replaced."""
    handle, part = tempfile.mkstemp(dir=path.parent)  # mode 0600
    try:
        with os.fdopen(handle, "w") as file:
            file.write(passwords)
        os.replace(part, path)
    except OSError:
        os.unlink(part)
        raise
