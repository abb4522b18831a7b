"""Names for the layouts of records that kernels read and write by field name.

The type checkers read the stub layouts.pyi, which lists the fields of each record; to Python and numba each name is `Any`.
"""

from typing import Any


def __getattr__(_name: str) -> Any:
    return Any
