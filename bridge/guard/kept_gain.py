"""The accepted exciter gain of a rig's loop check, kept over restarts: one file per rig."""

import json
import time
from collections.abc import Sequence
from typing import Any

from bridge.files import write_whole
from bridge.guard.latch import state_file

_MOST_BYTES = 1 << 16  # largest state file that is read


class KeptGain:
    """The accepted gain of one rig at each tone of its loop check.

    Args:
        rig: name of the rig in its file.
        tones_Hz: tones of its loop check; gains at other tones are not comparable.

    """

    def __init__(self, rig: str, tones_Hz: Sequence[float]) -> None:
        self.path = state_file("gain", rig)
        self._rig, self._tones_Hz = rig, [float(tone_Hz) for tone_Hz in tones_Hz]

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
        """Keep gains. Raises OSError if they cannot be written."""
        table = {"rig": self._rig, "tones_Hz": self._tones_Hz, "gain": [float(gain) for gain in gains]}
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        write_whole(self.path, json.dumps(table | {"at": time.strftime("%Y-%m-%dT%H:%M:%S%z")}))
