"""The same work by the version that is first on the path; `tests/speed/old_version.py` starts it twice and asks in turns.

`python version_worker.py old|new FOLDER`: a line `WORK SECONDS` in, the seconds that it took out.
"""

import importlib
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

# where the functions were in the version a44e824, and are now
_PLACES = {
    "old": {
        "run": "cockpit.onboard",
        "scenario": "cockpit.scenario",
        "log": "bridge.logfile",
        "replay": "cockpit.replaying",
        "messages": "bridge.messages",
        "speed": "tests.bench",
    },
    "new": {
        "run": "cockpit.run.in_process",
        "scenario": "cockpit.run.scenario",
        "log": "bridge.log.logfile",
        "replay": "cockpit.run.replay",
        "messages": "bridge.wire.messages",
        "speed": "tests.speed",
    },
}
_STEP_S = 1e-5
_VIBRATED_STEP_S = 6.25e-6


def _steps(version: str) -> Any:
    """A compiled function that takes all blocks of a run, as a run in one process does."""
    kernel: Any = importlib.import_module("bridge.kernel").kernel
    step = importlib.import_module("controller.core").step
    if version == "old":

        @kernel
        def of_old(params: Any, state: Any, sensors: Any, command: Any, trace: Any, scratch: Any) -> None:
            for i in range(sensors.shape[0]):
                step(params, state, sensors[i : i + 1], 1, 0, sensors[i].t_ns, command, trace, scratch)

        return of_old

    @kernel
    def of_new(params: Any, state: Any, sensors: Any, command: Any, trace: Any, scratch: Any) -> None:
        for i in range(sensors.shape[0]):
            step(params, state, sensors[i : i + 1], 1, 0, sensors[i].t_ns, command, trace)

    return of_new


class Worker:
    """Functions of a version and their data."""

    def __init__(self, version: str, folder: Path) -> None:
        places = _PLACES[version]
        modules = {name: importlib.import_module(place) for name, place in places.items()}
        self._run_onboard: Any = modules["run"].run_onboard
        self._load_scenario: Any = modules["scenario"].load_scenario
        self._read_run: Any = modules["log"].read_run
        self._changes_of: Any = modules["replay"].changes_of
        self._replay: Any = importlib.import_module("controller.replay").replay
        self._ours: Any = importlib.import_module(f"{places['speed']}.solvers").ours
        case: Any = importlib.import_module(f"{places['speed']}.case")
        self._messages = places["messages"]
        self._still = case.unvibrated()
        self._shaken = case.vibrated(self._still)
        self._log = folder / f"{version}.mcap"
        self._steps = _steps(version)
        self._told: tuple[Any, Any] | None = None

    def in_process(self, seconds: float) -> float:
        """A run with its log."""
        scenario = self._load_scenario("paper-c45-c45", [f"duration_s={seconds}"])
        begin_s = time.perf_counter()
        self._run_onboard(scenario, self._log, {})
        return time.perf_counter() - begin_s

    def replay(self, _seconds: float) -> float:
        """Reading the last log and replaying it."""
        begin_s = time.perf_counter()
        run = self._read_run(self._log)
        result = self._replay(run, self._changes_of(run, []))
        took_s = time.perf_counter() - begin_s
        if not result.identical:
            raise RuntimeError("a replay differs from its log")
        return took_s

    def controller(self, _seconds: float) -> float:
        """The controller's steps alone, over the blocks of the log."""
        if self._told is None:
            scenario = self._load_scenario("paper-c45-c45", [])
            self._told = scenario.controller, self._read_run(self._log).sensors
        config, sensors = self._told
        records, messages = importlib.import_module("controller.records"), importlib.import_module(self._messages)
        params, state = records.build(config)
        command, trace = messages.COMMAND.blank(), messages.TRACE.blank()
        begin_s = time.perf_counter()
        self._steps(params, state, sensors, command, trace, np.empty(sensors["drive_force_N"].shape[1]))
        return time.perf_counter() - begin_s

    def plant(self, _seconds: float) -> float:
        """The rig's kernel without vibration."""
        return float(self._ours(self._still, _STEP_S).wall_s)

    def vibrated(self, _seconds: float) -> float:
        """The rig's kernel with vibration."""
        return float(self._ours(self._shaken, _VIBRATED_STEP_S).wall_s)


if __name__ == "__main__":
    worker = Worker(sys.argv[1], Path(sys.argv[2]))
    print("ready", flush=True)
    for line in sys.stdin:
        work, asked_s = line.split()
        print(getattr(worker, work)(float(asked_s)), flush=True)
