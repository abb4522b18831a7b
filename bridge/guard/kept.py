"""The state of a rig that outlasts its process: the operator's stop, the accepted exciter gain and the warmth, a file per rig."""

import hashlib
import json
import math
import os
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bridge.files import write_whole

MOST_BYTES = 1 << 16  # largest state file that is read
_PROBE = b" " * 512  # about the size of the largest state file; a full disk often takes a name but no content


def state_folder() -> Path:
    """The folder of all state files of this user: $XDG_STATE_HOME/stickslip, else ~/.local/state/stickslip."""
    given = os.environ.get("XDG_STATE_HOME", "")
    # for a user without a home a folder that cannot be made, which is reported; `Path.home` would end the command
    home = Path("/", os.path.expanduser("~"))
    return (Path(given) if given else home / ".local" / "state") / "stickslip"


class StateFile:
    """One kind of state of a rig, in `state_folder`."""

    def __init__(self, kind: str, rig: str) -> None:
        folder = state_folder()
        name = "".join(letter if letter.isalnum() or letter in "-_" else "_" for letter in rig)[:60]
        # the hash separates names that differ only in replaced letters
        self.path = folder / f"{kind}-{name}-{hashlib.sha256(rig.encode()).hexdigest()[:8]}.json"
        self._rig = rig

    def _write(self, fields: dict[str, Any]) -> None:
        self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
        table = {"rig": self._rig} | fields | {"at": time.strftime("%Y-%m-%dT%H:%M:%S%z")}
        write_whole(self.path, json.dumps(table))


class StopLatch(StateFile):
    """The operator's stop of one rig; its file exists while the stop holds.

    Args:
        rig: name of the rig in its file.
        outlasts: whether the stop holds over restarts; False for a rig that `stickslip run` starts.

    """

    def __init__(self, rig: str, outlasts: bool = True) -> None:
        super().__init__("stop", rig)
        self.rig, self.outlasts = rig, outlasts

    @property
    def set_ns(self) -> int:
        """The time at which the stop was set, by the clock of its file [ns]; 0: no stop holds. An unreadable time is 1."""
        try:
            return self.path.lstat().st_mtime_ns
        except (FileNotFoundError, NotADirectoryError):
            return 0
        except OSError:
            return 1

    @property
    def is_set(self) -> bool:
        """Whether a stop holds; an unreadable file counts as a stop."""
        try:
            return os.path.lexists(self.path)
        except OSError:
            return True

    def can_be_set(self) -> str:
        """The reason why state files cannot be written, as text; empty if they can."""
        try:
            self.path.parent.mkdir(parents=True, exist_ok=True, mode=0o700)
            with tempfile.TemporaryFile(dir=self.path.parent, buffering=0) as probe:
                probe.write(_PROBE)
        except OSError as error:
            return f"{self.path.parent}: {error.strerror}"
        return ""

    def set(self, who: str) -> None:
        """Make the stop hold over restarts; `who` ordered it. Raises OSError if it cannot be written."""
        try:
            self._write({"by": who})
        except OSError:  # a full disk often still takes a name, and the name alone is a stop
            self.path.touch(mode=0o600)

    def who(self) -> str:
        """The sender of the stop that holds; empty if its file cannot be read."""
        try:
            with open(self.path, "rb") as file:
                return str(json.loads(file.read(MOST_BYTES))["by"])
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            return ""

    def clear(self) -> None:
        """Clear the stop on the operator's reset. Raises OSError if the file cannot be removed."""
        self.path.unlink(missing_ok=True)


class KeptGain(StateFile):
    """The accepted gain of one rig at each tone of its loop check.

    Args:
        rig: name of the rig in its file.
        tones_Hz: tones of its loop check; gains at other tones are not comparable.
        exciter_gain: gain of its rig file; after a change the next check is compared with the rig file again.

    """

    def __init__(self, rig: str, tones_Hz: Sequence[float], exciter_gain: float) -> None:
        super().__init__("gain", rig)
        self._check = {"tones_Hz": [float(tone_Hz) for tone_Hz in tones_Hz], "exciter_gain": exciter_gain}

    def load(self) -> list[float]:
        """The gains; empty without a file, and if the file is unreadable or belongs to another check."""
        try:
            with open(self.path, "rb") as file:
                table: Any = json.loads(file.read(MOST_BYTES))
            gains = [float(gain) for gain in table["gain"]]
            fits = {key: table[key] for key in self._check} == self._check and len(gains) == len(table["tones_Hz"])
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            return []
        return gains if fits and all(0.0 < gain < float("inf") for gain in gains) else []

    def save(self, gains: Sequence[float]) -> None:
        """Store the gains, one per tone, over restarts. Raises OSError if they cannot be written."""
        self._write(self._check | {"gain": [float(gain) for gain in gains]})


class KeptHeat(StateFile):
    """The modelled warmth of the exciter of one rig, over the largest allowed.

    Args:
        rig: name of the rig in its file.
        time_s: time constant of the exciter's cooling.

    """

    def __init__(self, rig: str, time_s: float) -> None:
        super().__init__("heat", rig)
        self._time_s = time_s

    def load(self) -> float:
        """The present warmth, cooled since it was stored; 0 without a file, 1 for an unreadable file."""
        try:
            with open(self.path, "rb") as file:
                table: Any = json.loads(file.read(MOST_BYTES))
            since_s = max(time.time() - float(table["unix_s"]), 0.0)  # a clock that was set back cools nothing
            heat_share = float(table["heat_share"]) * math.exp(-since_s / self._time_s)
        except FileNotFoundError:
            return 0.0
        except (OSError, ValueError, TypeError, KeyError, RecursionError):
            return 1.0
        return heat_share if 0.0 <= heat_share < math.inf else 1.0

    def save(self, heat_share: float) -> None:
        """Store the present warmth. Raises OSError if it cannot be written."""
        self._write({"heat_share": heat_share, "unix_s": time.time()})
