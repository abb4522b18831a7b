"""One test in Python: its rigs, and the log, picture and replay of each run once the test failed."""

import re
import shlex
import shutil
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Self

from bridge.faults import Fault
from bridge.files import write_whole
from cockpit.run.scenario_file import as_settings
from cockpit.testing.api import Rig, Run
from cockpit.testing.junit import properties_of
from cockpit.testing.target import Target


class Session:
    """The rigs of one test.

    Args:
        folder: of the test; scenarios may be files in it.
        target: their rig.

    """

    def __init__(self, folder: Path, target: Target) -> None:
        self._folder, self._target = folder, target
        self._logs = TemporaryDirectory(prefix="stickslip-")
        self._runs: list[Run] = []

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._logs.cleanup()
        self._runs.clear()  # pytest keeps its tests to the end: each run of 0.3 s held 340 kB

    def rig(self, scenario: str, **settings: Any) -> Rig:
        """The rig of a scenario. Raises Fault CONFIG."""
        file = self._folder / scenario.partition(":")[0]  # a case of a sweep: FILE.toml:CASE
        name = str(self._folder / scenario) if file.suffix == ".toml" and file.is_file() else scenario
        return Rig(name, as_settings(settings), self._target, Path(self._logs.name), self._runs)

    def properties(self, marked: list[str]) -> list[tuple[str, str]]:
        """Properties for JUnit XML: of each run, and the requirements `marked` for the test."""
        rows = [("requirement", name) for name in marked]
        for run in self._runs:
            rows += properties_of(run.tables.rig.name, run.tables.seed, run.checksum, run.results)
        return [*dict.fromkeys(rows)]

    def keep(self, folder: Path, test: str) -> tuple[list[Path], list[str]]:
        """Move the logs into a folder; their paths, and lines with the picture, the command that replays it, and its result."""
        from cockpit.run.replay import replay_log

        logs: list[Path] = []
        lines: list[str] = []
        name = re.sub(r"[^\w.-]+", "-", test.rpartition("/")[2]).strip("-")
        for number, run in enumerate(self._runs):
            kept = folder / f"{name}{f'-{number + 1}' if number else ''}.mcap"
            folder.mkdir(parents=True, exist_ok=True)
            shutil.move(run.log, kept)
            logs.append(kept)
            try:
                replayed = replay_log(kept, 0.0, [])
                word = "replays bit for bit" if replayed.identical else "; ".join(replayed.in_words())
            except Fault as fault:
                word = f"{fault.kind.code}: {fault.line}"
            lines.append(f"replay   stickslip replay {shlex.quote(str(kept))}: {word}")
            if drawn := run.picture():
                write_whole(kept.with_suffix(".svg"), drawn)
                lines.append(f"picture  {kept.with_suffix('.svg')}")
        return logs, lines
