"""Secret that permits arming from the page: readable on the terminal and in a file of this user only."""

import contextlib
import os
import secrets
import tempfile
from collections.abc import Generator
from pathlib import Path

from bridge.faults import Fault
from bridge.wire.loopback_users import folders, is_private_folder

_BYTES = 18  # random bytes; 24 letters in base64


@contextlib.contextmanager
def kept_token(port: int) -> Generator[tuple[str, Path]]:
    """A new token and its file, mode 0600, deleted at the end of the context.

    Raises Fault NOT_SECURE without a folder that other users cannot read.
    """
    token = secrets.token_urlsafe(_BYTES)
    path = _written(f"page-{port}.token", token)
    try:
        yield token, path
    finally:
        with contextlib.suppress(OSError):
            if path.read_text() == token:  # unless a later server of this port has replaced it
                path.unlink()


def _written(name: str, token: str) -> Path:
    for folder in folders():
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not is_private_folder(folder):
                continue
            handle, part = tempfile.mkstemp(dir=folder)  # mode 0600
            with os.fdopen(handle, "w") as file:
                file.write(token)
            os.replace(part, folder / name)
            return folder / name
    places = ", ".join(str(folder) for folder in folders())
    line = f"no private folder for the page's token: {places} must belong to this user, mode 0700"
    raise Fault("NOT_SECURE", f"{line}; set XDG_RUNTIME_DIR to such a folder")
