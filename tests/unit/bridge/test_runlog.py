"""The message about a log that cannot be written to its end."""

import math
import os
import resource
from pathlib import Path

import pytest

from bridge.faults import Fault
from bridge.log.logfile import read_run
from bridge.log.runlog import RunLog
from bridge.wire.messages import sensor_block
from bridge.wire.topics import SENSORS


def _write(log: RunLog, blocks: range) -> None:
    record = sensor_block(20).blank()
    for block in blocks:
        record["sequence"], record["t_ns"] = block, 1_000_000 * (block + 1)
        log.write(SENSORS, record.tobytes())


@pytest.mark.parametrize(
    ("blocks", "message"), [(20, "closed at 0.02 s, "), (0, "closed before anything was recorded; ")]
)
def test_a_full_disk_reports_the_time_of_the_last_whole_chunk(tmp_path: Path, blocks: int, message: str) -> None:
    path = tmp_path / "run.mcap"
    log = RunLog(path, lockstep=True)
    log._due_s = math.inf  # no chunk ends by itself
    _write(log, range(blocks))
    log.flush()
    _write(log, range(blocks, blocks + 300))
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (path.stat().st_size + 60, before[1]))
    try:
        with pytest.raises(Fault, match=f"LOG_WRITE: .*{message}"):
            log.close()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)
    assert len(read_run(path).sensors) == blocks


def test_a_log_is_not_written_to_a_pipe(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.mcap")
    with pytest.raises(Fault, match=r"CONFIG: .*pipe.mcap: is a pipe or socket"):
        RunLog(tmp_path / "pipe.mcap", lockstep=True)
