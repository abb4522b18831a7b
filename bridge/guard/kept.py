"""The state of a rig that outlasts its process: the operator's stop and the accepted exciter gain, a file per rig."""

import hashlib
import json
import os
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bridge.files import write_whole

_MOST_BYTES = 1 << 16  # largest state file that is read


class _StateFile:
    """One kind of state of a rig, in $XDG_STATE_HOME/stickslip, else ~/.local/state/stickslip."""

    def __init__(self, kind: str, rig: str) -> None:
        given = os.environ.get("XDG_STATE_HOME", "")
        folder = (Path(given) if given else Path.home() / ".local" / "state") / "stickslip"
        name = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in rig)[:60]
        # the hash separates names that differ only in replaced letters
        self.path = folder / f"{kind}-{name}-{hashlib.sha256(rig.encode()).hexdigest()[:8]}.json"
        self._rig = rig

    def _write(self, fields: dict[str, Any]) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        table = {"rig": self._rig} | fields | {"at": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
        write_whole(self.path, json.dumps(table))


class StopLatch(_StateFile):
    """The operator's stop of one rig; its file exists while the stop holds.

    Args:
        rig: name of the rig in its file.

    """

    def __init__(self, rig: str) -> None:
        super().__init__("stop", rig)

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
        """Make the stop hold over restarts; `who` ordered it. Raises OSError if it cannot be written."""
        self._write({"by": who})

    def clear(self) -> None:
        """Clear the stop on the operator's reset. Raises OSError if the file cannot be removed."""
        self.path.unlink(missing_ok=True)


class KeptGain(_StateFile):
    """The accepted gain of one rig at each tone of its loop check.

    Args:
        rig: name of the rig in its file.
        tones_Hz: tones of its loop check; gains at other tones are not comparable.

    """

    def __init__(self, rig: str, tones_Hz: Sequence[float]) -> None:
        super().__init__("gain", rig)
        self._tones_Hz = [float(tone_Hz) for tone_Hz in tones_Hz]

    def load(self) -> list[float]:
        """The gains; empty without a file, and if the file is unreadable or has other tones."""
        try:
            with open(self.path, "rb") as file:
                table: Any = json.loads(file.read(_MOST_BYTES))
            gains = [float(gain) for gain in table["gain"]]
            fits = table["tones_Hz"] == self._tones_Hz and len(gains) == len(self._tones_Hz)
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            return []
        return gains if fits and all(0.0 < gain < float("inf") for gain in gains) else []

    def save(self, gains: Sequence[float]) -> None:
        """Store the gains, one per tone, over restarts. Raises OSError if they cannot be written."""
        self._write({"tones_Hz": self._tones_Hz, "gain": [float(gain) for gain in gains]})
