"""Every fault that an operator must act on: a short code, an exit status, a paragraph of help; `faults.toml` lists them."""

import tomllib
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple


class FaultKind(NamedTuple):
    """One row of `FAULTS`."""

    code: str
    exit_status: int
    help: str


_TABLE: dict[str, Any] = tomllib.loads(Path(__file__).with_name("faults.toml").read_text(encoding="utf-8"))
FAULTS = {code: FaultKind(code, **row) for code, row in _TABLE.items()}


class Fault(Exception):
    """A fault: its row of `FAULTS`, and one line for the user.

    The line has the form `where = value: rule; remedy`. Raises KeyError for a code that is not in `FAULTS`.
    """

    def __init__(self, code: str, line: str) -> None:
        self.kind = FAULTS[code]
        self.line = line
        Exception.__init__(self, f"{code}: {line}")

    def __reduce__(self) -> tuple[type["Fault"], tuple[str, str]]:
        """Pickle code and line, for another process; by default Python rebuilds an exception from its message alone."""
        return Fault, (self.kind.code, self.line)


def install(extra: str) -> str:
    """The command that installs an extra of this project: in a checkout from its source tree, which no index holds."""
    root = Path(__file__).parents[1]
    pip = "pip" if find_spec("pip") else "uv pip"  # an environment of uv has no pip
    return f"{pip} install " + (
        f"-e '{root}[{extra}]'" if (root / "pyproject.toml").is_file() else f"'stickslip[{extra}]'"
    )
