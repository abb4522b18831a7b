"""Install a lock file's packages into this Python's environment: by uv where it is on the PATH, else by pip; shows how far it is.

    .venv/bin/python .ci/install.py requirements.lock [--project]

With `--project` the folder itself is installed as well, as it lies there. Errors of the installer are shown, warnings only then.
"""

import importlib.util
import re
import shutil
import subprocess
import sys
from collections.abc import Sequence
from pathlib import Path

_PACKAGE = re.compile(r"^[A-Za-z0-9][\w.-]*==", re.MULTILINE)
_FETCHED = re.compile(r"^\s*(Downloading|Using cached) ([\w.]+-[\w.]+)-\S*(?: \((\d+\.\d+ [kM]B)\))?")
_PROJECT = ["--no-deps", "--no-build-isolation", "--editable", "."]


def _show(line: str, total: int, done: int) -> int:
    """Show a package of pip's output that is fetched; the number of packages up to now."""
    if fetched := _FETCHED.match(line):
        done += 1
        print(f"  {done} of {total} {fetched[2]} {fetched[3] or ''}".rstrip(), flush=True)
    elif line.startswith("Installing collected"):
        print("  unpacking them", flush=True)
    return done


def _by_pip(arguments: Sequence[str], total: int) -> int:
    if importlib.util.find_spec("pip") is None:  # of an environment that was made for uv
        subprocess.run([sys.executable, "-m", "ensurepip"], check=True, stdout=subprocess.DEVNULL)
    command = [
        sys.executable,
        "-m",
        "pip",
        "install",
        "--disable-pip-version-check",
        "--progress-bar=off",
        "--no-compile",
    ]
    done, kept = 0, list[str]()
    with subprocess.Popen(
        [*command, *arguments], stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, bufsize=1
    ) as pip:
        assert pip.stdout is not None  # noqa: S101
        for line in pip.stdout:
            kept.append(line)
            done = _show(line, total, done)
    if pip.returncode:
        print("".join(line for line in kept if not _FETCHED.match(line)), file=sys.stderr)
    return pip.returncode


def main(lock: str, project: bool) -> int:
    """Install; the exit status of the first installer that fails."""
    total = len(_PACKAGE.findall(Path(lock).read_text(encoding="utf-8")))
    uv = shutil.which("uv")
    print(f"installing the packages of {lock}, {total} at most, by {'uv' if uv else 'pip'}", flush=True)
    # the lock names every package, so there is nothing to resolve
    for arguments in (["--no-deps", "--require-hashes", "--requirement", lock], _PROJECT)[: 2 if project else 1]:
        if uv:
            status = subprocess.run(
                [uv, "pip", "install", "--python", sys.executable, *arguments], check=False
            ).returncode
        else:
            status = _by_pip(arguments, total)
        if status:
            return status
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1], "--project" in sys.argv[2:]))
