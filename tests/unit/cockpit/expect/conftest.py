"""One short run, whose log the tests change before they judge it."""

from pathlib import Path

import pytest

from bridge.log.logfile import RunData, read_run
from cockpit.run.in_process import run_onboard
from cockpit.run.scenario import load_scenario


@pytest.fixture(scope="package")
def run(tmp_path_factory: pytest.TempPathFactory) -> RunData:
    """Two seconds of the paper's rig under control from the start."""
    path: Path = tmp_path_factory.mktemp("expect") / "run.mcap"
    run_onboard(load_scenario("from-the-start", ["duration_s=2.0"]), path, {})
    return read_run(path)
