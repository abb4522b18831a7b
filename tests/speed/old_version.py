"""This version and an older one in turns on the same computer."""

import io
import os
import subprocess
import sys
import tarfile
import tempfile
from pathlib import Path
from statistics import median
from typing import NamedTuple

from tests.speed.runs import bar

ROOT = Path(__file__).parents[2]
OLD = "a44e824"
TURNS, QUICK_TURNS = 9, 3
RUN_S = 20.0  # simulated, in one process


class Gain(NamedTuple):
    """A comparison, and the required ratio of the speeds."""

    name: str
    work: str  # of `version_worker`
    least: float


GAINS = [
    # with the old controller in both versions the bars were 7 and 1.9; now 70 % of each: both directions are estimated
    Gain("in one process, log written", "in_process", 4.9),
    Gain("replay, reading included", "replay", 1.33),
    Gain("the rig's kernel, no vibration", "plant", 3.3),
    # it estimates in both directions, learns, and judges the contact every millisecond: this may cost half as much again
    Gain("the controller's steps", "controller", 0.667),
    # no slower; the scatter of medians of turns on a shared machine is some 5 %
    Gain("the rig's kernel, 3 kHz", "vibrated", 0.95),
]


class _Version:
    """A version in a separate process."""

    def __init__(self, name: str, tree: Path, folder: Path) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-P", str(Path(__file__).with_name("version_worker.py")), name, str(folder)],
            cwd=tree,
            env=os.environ | {"PYTHONPATH": str(tree)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )

    def answer(self) -> str:
        """Its next line."""
        assert self._process.stdout is not None
        line = self._process.stdout.readline()
        if not line:
            raise RuntimeError(f"a version ended with status {self._process.wait()}")
        return line

    def took_s(self, work: str) -> float:
        """How long it takes for a work [s]."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{work} {RUN_S}\n")
        self._process.stdin.flush()
        return float(self.answer())

    def end(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.communicate()


def bench(quick: bool = False) -> bool:
    """Print the ratios; whether every bar is kept."""
    print(f"\nthis version beside {OLD}, medians of {QUICK_TURNS if quick else TURNS} turns")
    files = subprocess.run(["git", "archive", OLD], cwd=ROOT, capture_output=True, check=False)
    if files.returncode:
        print(f"  {OLD} is not in the history of this checkout: not measured")
        return True
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder) / "old"
        with tarfile.open(fileobj=io.BytesIO(files.stdout)) as archive:
            archive.extractall(tree, filter="data")
        versions = [_Version("new", ROOT, Path(folder)), _Version("old", tree, Path(folder))]
        try:
            for version in versions:
                version.answer()
            kept = [_gained(gain, *versions, QUICK_TURNS if quick else TURNS) for gain in GAINS]
            return all(kept)
        finally:
            for version in versions:
                version.end()


def _gained(gain: Gain, new: _Version, old: _Version, turns: int) -> bool:
    for version in (new, old):
        version.took_s(gain.work)  # loads the kernels, or compiles them
    taken_s = [(new.took_s(gain.work), old.took_s(gain.work)) for _ in range(turns)]
    times = median(before_s for _, before_s in taken_s) / median(now_s for now_s, _ in taken_s)
    return bar(f"{gain.name} [times as fast]", times, times >= gain.least, f"at least {gain.least:g}")
