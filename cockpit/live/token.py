"""The word that lets a person arm a rig from the page: who can read this user's files, or the terminal, has it."""

import contextlib
import os
import secrets
import tempfile
from collections.abc import Generator
from pathlib import Path

from bridge.faults import Fault
from bridge.wire.loopback_users import folders, is_private_folder

_BYTES = 18  # of chance; 24 letters


@contextlib.contextmanager
def kept_token(port: int) -> Generator[tuple[str, Path]]:
    """A new word and the file that holds it, mode 0600, for as long as the server of this port runs.

    Raises Fault NOT_SECURE where no folder can hold it so that others cannot read it.
    """
    word = secrets.token_urlsafe(_BYTES)
    path = _written(f"page-{port}.token", word)
    try:
        yield word, path
    finally:
        with contextlib.suppress(OSError):
            if path.read_text() == word:  # not that of a server that took the port meanwhile
                path.unlink()


def _written(name: str, word: str) -> Path:
    for folder in folders():
        with contextlib.suppress(OSError):
            folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            if not is_private_folder(folder):
                continue
            handle, part = tempfile.mkstemp(dir=folder)  # mode 0600
            with os.fdopen(handle, "w") as file:
                file.write(word)
            os.replace(part, folder / name)
            return folder / name
    places = ", ".join(str(folder) for folder in folders())
    line = f"the page's token cannot be kept where others cannot read it: {places} must be this user's, mode 0700"
    raise Fault("NOT_SECURE", f"{line}; set XDG_RUNTIME_DIR to such a folder")
