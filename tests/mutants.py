"""`make mutants`: every condition of the guard is changed in turn, and its unit tests must notice; `python -m tests.mutants`.

Cosmic Ray changes the files of a copy: each comparison gets its edge moved and is turned round, each `and` becomes `or` and the
other way round, each condition gets a `not`. Kernels run interpreted, as a change would compile them anew.
"""

import argparse
import os
import shutil
import sqlite3
import subprocess
import sys
from pathlib import Path
from typing import NamedTuple

MOST_SURVIVE = 0.1
TESTS = "tests/unit/bridge/guard"
# of a file, its tests in the order in which they are likely to notice
MODULES = {
    "core": ("core", "states", "limits"),
    "limits": ("limits", "core", "states"),
    "senses": ("limits", "states", "core"),
    "states": ("states", "core", "limits"),
    "check": ("states", "core", "limits"),
}
CHANGES = (
    "ReplaceComparisonOperator_(Eq_NotEq|NotEq_Eq|Lt_LtE|LtE_Lt|Gt_GtE|GtE_Gt|Lt_GtE|LtE_Gt|Gt_LtE|GtE_Lt)$",
    "ReplaceAndWithOr|ReplaceOrWithAnd|AddNot|ReplaceUnaryOperator_Delete_Not|ReplaceTrueWithFalse|ReplaceFalseWithTrue",
)
_LONGEST_S = 600.0  # of the tests after a change, as some changes never end


class Count(NamedTuple):
    """Of one file."""

    changed: int
    survived: list[str]  # place and change of each


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
    with sqlite3.connect(session) as found:
        rows = found.execute(
            "SELECT start_pos_row, operator_name, test_outcome, diff FROM work_results JOIN mutation_specs USING (job_id) "
            "WHERE worker_outcome != 'SKIPPED'"
        ).fetchall()
    survived = [
        f"bridge/guard/{module}.py:{row}: {operator.removeprefix('core/')}\n{diff}"
        for row, operator, outcome, diff in rows
        if str(outcome).endswith("SURVIVED")
    ]
    return Count(len(rows), survived)


def main() -> int:
    """Exit status 1: too many survived."""
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("modules", nargs="*", default=list(MODULES), help="Of the guard; all five if not given.")
    modules = options.parse_args().modules
    folder = Path("runs/mutants")
    copy_to(folder)
    counts: list[Count] = []
    for module in modules:
        counts.append(run(module, folder))
        print(f"{module}: {len(counts[-1].survived)} of {counts[-1].changed} changed conditions survive", flush=True)
    changed, survived = sum(one.changed for one in counts), [line for one in counts for line in one.survived]
    print("\n".join(survived))
    print(f"{len(survived)} of {changed} changed conditions survive: at most {MOST_SURVIVE:.0%} may")
    return int(len(survived) > MOST_SURVIVE * changed)


if __name__ == "__main__":
    sys.exit(main())
