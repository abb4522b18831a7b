"""`make mutants`: every condition of the guard is changed in turn, and its unit tests must notice.

`python -m tests.mutants --report FILE` writes the page.

Cosmic Ray changes the files of a copy: each comparison gets its edge moved and is turned round, each `and` becomes `or` and the
other way round, each condition gets a `not`. Kernels run interpreted, as each change would need a compilation.
"""

import argparse
import os
import shutil
import sqlite3
import subprocess
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

MOST_SURVIVE = 0.1
TESTS = "tests/unit/bridge/guard"
# of a file, its tests in the order in which they are likely to notice
MODULES = {
    "core": ("core", "states", "limits"),
    "limits": ("limits", "core", "states"),
    "estimates": ("limits", "states", "core"),
    "states": ("states", "core", "limits"),
    "check": ("states", "core", "limits"),
}
CHANGES = (
    "ReplaceComparisonOperator_(Eq_NotEq|NotEq_Eq|Lt_LtE|LtE_Lt|Gt_GtE|GtE_Gt|Lt_GtE|LtE_Gt|Gt_LtE|GtE_Lt)$",
    "ReplaceAndWithOr|ReplaceOrWithAnd|AddNot|ReplaceUnaryOperator_Delete_Not|ReplaceTrueWithFalse|ReplaceFalseWithTrue",
)
# changes after which the guard does the same, by the changed line: no test can notice them
SAME = {
    "if frequency_Hz < p.tone_Hz[0]:": "the line between the tones goes through them",
    "if frequency_Hz < p.tone_Hz[i]:": "the line between the tones goes through them",
    "if velocity_mps >= fastest_mps:": "of two equal velocities either is the larger",
    "elif velocity_mps >= second_mps:": "of two equal velocities either is the larger",
    "if determinant <= 1e-9:": "a measured number is never equal to the last bit",
    "if s.amplitude_m == 0.0 or not s.tone_mps2 >= _ANSWERS * s.quiet_mps2:": "a measured number is never equal to the last bit",
    "if s.tone_mps2 > _ANSWERS * s.quiet_mps2:": "a measured number is never equal to the last bit",
    "if slide_mps >= _STICKS * drive_mps:": "a measured number is never equal to the last bit",
}
_ABOUT = (
    "Made by `python -m tests.mutants --report runs/mutants.md`; `make mutants` runs the same and fails where more than "
    f"{MOST_SURVIVE:.0%} of the",
    "changes go unnoticed. Each comparison of the guard's kernels gets its edge moved and is turned round, each `and` becomes "
    "`or`",
    "and the other way round, each condition gets a `not`, each `True` becomes `False`; after each change its unit tests run.",
)
_LONGEST_S = 600.0  # of the tests after a change, as some changes never end


class Survivor(NamedTuple):
    """A change that no test noticed."""

    place: str  # file and line
    change: str  # the changed line

    @property
    def why(self) -> str:
        """Why no test can notice it; empty where one could."""
        return SAME.get(self.change, "")


class Count(NamedTuple):
    """Of one file."""

    module: str
    changed: int
    survived: list[Survivor]


def copy_to(folder: Path) -> None:
    """The guard and its tests, nothing else."""
    shutil.rmtree(folder, ignore_errors=True)
    (folder / TESTS).mkdir(parents=True)
    shutil.copytree("bridge", folder / "bridge", dirs_exist_ok=True, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy("pyproject.toml", folder)
    for place in ("tests", "tests/unit", "tests/unit/bridge", TESTS):
        for path in Path(place).glob("*.py"):
            shutil.copy(path, folder / place)


def run(module: str, folder: Path) -> Count:
    """Change one file of the copy, and count."""
    tests = " ".join(f"{TESTS}/test_{name}.py" for name in MODULES[module])
    config, session = folder / f"{module}.toml", folder / f"{module}.sqlite"
    config.write_text(
        f'[cosmic-ray]\nmodule-path = ["bridge/guard/{module}.py"]\ntimeout = {_LONGEST_S}\nexcluded-modules = []\n'
        f'test-command = "{sys.executable} -m pytest -x -q -p no:cacheprovider {tests}"\n'
        '[cosmic-ray.distributor]\nname = "local"\n'
        f"[cosmic-ray.filters.operators-filter]\nexclude-operators = ['core/(?!{'|'.join(CHANGES)}).*']\n"
    )
    environment = os.environ | {"NUMBA_DISABLE_JIT": "1", "PYTHONDONTWRITEBYTECODE": "1"}
    tools = Path(sys.executable).parent
    for words in (
        ("cosmic-ray", "init", config.name, session.name),
        ("cr-filter-operators", session.name, config.name),
        ("cosmic-ray", "baseline", config.name),
        ("cosmic-ray", "exec", config.name, session.name),
    ):
        subprocess.run([str(tools / words[0]), *words[1:]], cwd=folder, env=environment, check=True)
    with sqlite3.connect(session) as database:
        rows = database.execute(
            "SELECT start_pos_row, test_outcome, diff FROM work_results JOIN mutation_specs USING (job_id) "
            "WHERE worker_outcome != 'SKIPPED'"
        ).fetchall()
    survived = [
        Survivor(f"bridge/guard/{module}.py:{row}", next(_added(diff)))
        for row, outcome, diff in rows
        if str(outcome).endswith("SURVIVED")
    ]
    return Count(module, len(rows), sorted(survived))


def _added(diff: str) -> Iterator[str]:
    return (line[1:].strip() for line in diff.splitlines() if line.startswith("+") and not line.startswith("+++"))


def page(counts: Sequence[Count]) -> str:
    """The result in Markdown."""
    rows = [(f"`bridge/guard/{count.module}.py`", count.changed, count.survived) for count in counts]
    rows.append(("all", sum(row[1] for row in rows), [m for row in rows for m in row[2]]))
    table = [
        f"| {name} | {changed} | {len(survived)} | {len(survived) / changed:.1%} | {sum(not m.why for m in survived)} |"
        for name, changed, survived in rows
    ]
    left = [f"| `{m.place}` | `{m.change}` | {m.why or 'a test could notice it'} |" for m in rows[-1][2]]
    return "\n".join([
        "# Mutants of the guard", "",
        *_ABOUT, "",
        "| file | changed conditions | survive | share | of them a test could notice |", "|---|---|---|---|---|", *table, "",
        "## Those that survive", "",
        *(["| line | as changed | why |", "|---|---|---|", *left] if left else ["None."]), "",
    ])  # fmt: skip


def main() -> int:
    """Exit status 1: too many survived."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("modules", nargs="*", default=list(MODULES), help="Of the guard; all five if not given.")
    options.add_argument("--report", type=Path, metavar="FILE", help="Write the page, one .md file.")
    given = options.parse_args()
    folder = Path("runs/mutants")
    copy_to(folder)
    counts: list[Count] = []
    for module in given.modules:
        counts.append(run(module, folder))
        print(f"{module}: {len(counts[-1].survived)} of {counts[-1].changed} changed conditions survive", flush=True)
    changed, survived = sum(file.changed for file in counts), [line for file in counts for line in file.survived]
    print("\n".join(f"{m.place}: {m.change}  ({m.why or 'a test could notice it'})" for m in survived))
    print(f"{len(survived)} of {changed} changed conditions survive: at most {MOST_SURVIVE:.0%} may")
    if given.report is not None:
        given.report.parent.mkdir(parents=True, exist_ok=True)
        given.report.write_text(page(counts))
    return int(len(survived) > MOST_SURVIVE * changed)


if __name__ == "__main__":
    sys.exit(main())
