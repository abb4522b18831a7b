"""The operator's stop of a rig, kept over restarts: one file per rig in the user's state directory, while the stop holds."""

import hashlib
import json
import os
import time
from pathlib import Path

from bridge.files import write_whole


def state_folder() -> Path:
    """The folder for the state of this user's programs: $XDG_STATE_HOME/stickslip, else ~/.local/state/stickslip."""
    given = os.environ.get("XDG_STATE_HOME", "")
    return (Path(given) if given else Path.home() / ".local" / "state") / "stickslip"


def state_file(kind: str, rig: str) -> Path:
    """The state file of a rig, by its name; names that differ only in replaced letters still get different files."""
    name = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in rig)[:60]
    return state_folder() / f"{kind}-{name}-{hashlib.sha256(rig.encode()).hexdigest()[:8]}.json"


class StopLatch:
    """The stop of one rig.

    Args:
        rig: name of the rig in its file.

    """

    def __init__(self, rig: str) -> None:
        self.path = state_file("stop", rig)
        self._rig = rig

    @property
    def is_set(self) -> bool:
        """Whether a stop holds; an unreadable file counts as a stop."""
        try:
            return os.path.lexists(self.path)
        except OSError:
            return True

    def can_be_set(self) -> str:
        """The reason why a stop cannot be kept, as text; empty if it can be kept."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError as error:
            return f"{self.path.parent}: {error.strerror}"
        return "" if os.access(self.path.parent, os.W_OK) else f"{self.path.parent}: is not writable"

    def set(self, who: str) -> None:
        """Keep a stop. Raises OSError if it cannot be written."""
        text = json.dumps({"rig": self._rig, "by": who, "at": time.strftime("%Y-%m-%dT%H:%M:%S%z")})
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_whole(self.path, text)

    def clear(self) -> None:
        """Clear the stop on the operator's reset. Raises OSError if the file cannot be removed."""
        self.path.unlink(missing_ok=True)
