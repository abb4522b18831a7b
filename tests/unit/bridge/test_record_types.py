"""The type checkers know the fields of the records that kernels read and write."""

import subprocess
import sys
from pathlib import Path

import pytest

from bridge.kernel_cache import ROOT
from docs.layouts import STUB, stub

BIN = Path(sys.executable).parent
KERNEL = (
    "from bridge.layouts import ControllerMemory\n\n\ndef allowed(s: ControllerMemory) -> float:\n    return s.{}\n"
)


def test_the_stub_is_up_to_date() -> None:
    assert STUB.read_text(encoding="utf-8") == stub(), "make layouts"


@pytest.mark.parametrize(
    "checker",
    [
        ("ty", "check", "--project", str(ROOT), "--python", sys.prefix),
        pytest.param(("pyright", "--project", str(ROOT)), marks=pytest.mark.nightly),
    ],
    ids=["ty", "pyright"],
)
def test_a_misspelt_field_fails_the_type_check(tmp_path: Path, checker: tuple[str, ...]) -> None:
    for field, status in (("allowed_m", 0), ("alowed_m", 1)):
        kernel = tmp_path / f"{field}.py"
        kernel.write_text(KERNEL.format(field))
        command = [BIN / checker[0], *checker[1:], str(kernel)]
        result = subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=False)
        assert result.returncode == status, result.stdout
        assert ("alowed_m" in result.stdout) == (status == 1)
