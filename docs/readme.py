"""The outputs and the picture of README.md: `make readme` runs the commands, keeps their outputs, and copies lines of them.

tests/unit/test_docs.py compares README.md with the kept output, tests/system/test_readme.py the kept output with the commands.
"""

import os
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from bench.control.axes_map import reduce_colours

ROOT = Path(__file__).parents[1]
README = ROOT / "README.md"
KEPT = Path(__file__).parent / "start" / "example.txt"
PICTURE = KEPT.with_name("demo.png")
# In simulated time, so that the same scenario prints the same lines on each computer.
DEMO = "stickslip run --in-process --scenario paper-c45-c45 --log runs/demo.mcap"
_EXAMPLE = re.compile(r"^    (stickslip example .*?)(?: +#.*)?$", re.MULTILINE)
_BLOCK = re.compile(r"(?<=<!-- made by `make readme` -->\n\n).*?(?=\n\n)", re.DOTALL)


def commands(readme: str) -> list[str]:
    """The demo in simulated time, and the commands that the README gives for a diagnosis."""
    match = _EXAMPLE.search(readme)
    if match is None:
        raise ValueError("README.md: must give the command `stickslip example ...`, four blanks before it")
    return [DEMO, *match[1].split(" && ")]


def run(command: str, folder: Path) -> str:
    """The stdout of a command, run in a folder by this Python.

    Raises subprocess.CalledProcessError where it fails.
    """
    words = [sys.executable, "-P", "-m", "cockpit", *command.split()[1:]]
    usual = os.environ | {"COLUMNS": "130"}
    return subprocess.run(words, cwd=folder, env=usual, stdout=subprocess.PIPE, text=True, check=True).stdout


def kept(readme: str, picture: Path) -> str:
    """The whole output of all commands, each below its command; the picture shows the demo."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "runs").mkdir()
        text = "\n".join(f"$ {command}\n{run(command, Path(folder))}" for command in commands(readme))
        run("stickslip plot runs/demo.mcap", Path(folder))
        shutil.copyfile(Path(folder) / "runs" / "demo.png", picture)
    reduce_colours(picture)
    return text


def block(text: str) -> str:
    """The lines of the kept output that the README shows: the first of the demo, and the answer of the diagnosis."""
    lines = text.splitlines()
    demo = lines[lines.index(f"$ {DEMO}") + 1]
    answer = lines[next(number for number, line in enumerate(lines) if line.startswith("effect:")) :]
    return "\n".join(f"    {line}" for line in (demo, *answer))


def main() -> None:
    """Run the commands, and write the kept output, the picture and the README's block."""
    readme = README.read_text(encoding="utf-8")
    text = kept(readme, PICTURE)
    KEPT.write_text(text, encoding="utf-8")
    README.write_text(_BLOCK.sub(lambda _: block(text), readme), encoding="utf-8")


if __name__ == "__main__":
    main()
