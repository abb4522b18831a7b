"""A person's stop of a rig, kept over restarts: a file a rig in the user's state directory, there while the stop holds."""

import hashlib
import json
import os
import time
from pathlib import Path

from bridge.files import write_whole


def state_folder() -> Path:
    """Where the state of this user's programs is kept: $XDG_STATE_HOME/stickslip, else ~/.local/state/stickslip."""
    given = os.environ.get("XDG_STATE_HOME", "")
    return (Path(given) if given else Path.home() / ".local" / "state") / "stickslip"


def state_file(what: str, rig: str) -> Path:
    """Where something is kept of a rig by its name; two names that differ in other letters alone are two rigs."""
    name = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in rig)[:60]
    return state_folder() / f"{what}-{name}-{hashlib.sha256(rig.encode()).hexdigest()[:8]}.json"


class StopLatch:
    """The stop of one rig.

    Args:
        rig: its name, as the rig file has it.

    """

    def __init__(self, rig: str) -> None:
        self.path = state_file("stop", rig)
        self._rig = rig

    @property
    def is_set(self) -> bool:
        """Whether a stop holds; a file that cannot be read holds, too."""
        try:
            return os.path.lexists(self.path)
        except OSError:
            return True

    def can_be_set(self) -> str:
        """Why a stop could not be kept here, in words; empty where it can."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        except OSError as error:
            return f"{self.path.parent}: {error.strerror}"
        return "" if os.access(self.path.parent, os.W_OK) else f"{self.path.parent}: is not writable"

    def set(self, who: str) -> None:
        """Keep a stop. Raises OSError where it cannot be written."""
        text = json.dumps({"rig": self._rig, "by": who, "at": time.strftime("%Y-%m-%dT%H:%M:%S%z")})
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_whole(self.path, text)

    def clear(self) -> None:
        """A person has reset the rig. Raises OSError where the file cannot be removed."""
        self.path.unlink(missing_ok=True)
