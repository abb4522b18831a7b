"""The lock of a log that is being recorded: other processes must neither write nor replace the file."""

import fcntl
from pathlib import Path
from typing import IO

from bridge.faults import Fault


def locked(file: IO[bytes]) -> bool:
    """Lock a log against writing and replacing by other processes; False when another process has the lock."""
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        pass
    return True


def refuse_a_live_log(path: Path, option: str) -> None:
    """Raise Fault LOG_WRITE when `path` is a log that is being recorded; `option` is the option that names another file."""
    if not path.is_file():
        return
    with path.open("rb") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            line = f"{path}: is being recorded: must be closed before it is replaced, or the rest of the run is lost"
            raise Fault("LOG_WRITE", f"{line}; wait for the end of the run, or give another {option}") from None
        except OSError:  # a file system without locks
            return
