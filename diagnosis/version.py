"""The version that a kept result or score belongs to: a hash over the definitions that make a diagnosis.

Scores of different versions are never mixed, and a sealed set costs hours. So the hash covers the definitions that an answer
depends on and no others: it changes with a number, a formula or a rule, and stays the same when a comment, a docstring or an
import changes, a definition moves to another file, or the words and pictures of the report or of
the catalogue of effects are improved.
"""

import ast
import functools
import hashlib
from collections.abc import Iterator
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

# without bridge: its unit tests check how files are read, and the golden logs check the bits of compiled kernels
JUDGED = ("plant", "diagnosis")
# the version itself, texts and pictures of a finished answer, and the plant as a process
NOT_JUDGED = (
    "diagnosis/version.py",
    "diagnosis/report",
    "diagnosis/pictures",
    "plant/rig",
)
# fields of a row of `diagnosis.hypotheses.catalogue` that only texts and pictures use
_NOT_JUDGED_KEYWORDS = {"words", "shown_by", "shown_twice"}


@functools.cache
def tool_version(*further: str) -> str:
    """Version of the package with a hash over all definitions that make a diagnosis, and over `further` folders below the root.

    The sources are read at the first call, when the process has loaded its code.
    """
    try:
        number = version("stickslip")
    except PackageNotFoundError:
        number = "unknown"
    root = Path(__file__).parents[1]
    return f"{number}+{definitions_digest(root, (*JUDGED, *further), NOT_JUDGED)}"


def definitions_digest(root: Path, judged: tuple[str, ...], not_judged: tuple[str, ...] = ()) -> str:
    """Hash over the top-level statements of all files below `judged`, in sorted order. Raises OSError and SyntaxError.

    A place is a file or a folder, relative to `root`; a place that does not exist counts as empty.
    """
    left_out = {root / place for place in not_judged}
    files = [path for place in judged for path in _files(root / place)]
    judged_files = [path for path in files if not left_out & {path, *path.parents}]
    statements = [text for path in judged_files for text in _statements(path)]
    return hashlib.sha256("\n".join(sorted(statements)).encode()).hexdigest()[:12]


def _files(place: Path) -> Iterator[Path]:
    return iter([place]) if place.is_file() else place.rglob("*.py")


def _statements(path: Path) -> Iterator[str]:
    tree = _Judged().visit(ast.parse(path.read_text(encoding="utf-8")))
    for statement in tree.body:
        if not isinstance(statement, ast.Import | ast.ImportFrom):
            yield ast.unparse(statement)


class _Judged(ast.NodeTransformer):
    """Removes docstrings, and the fields of a row that only texts and pictures use."""

    def visit_keyword(self, node: ast.keyword) -> ast.AST | None:
        return None if node.arg in _NOT_JUDGED_KEYWORDS else self.generic_visit(node)

    def generic_visit(self, node: ast.AST) -> ast.AST:
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef) and ast.get_docstring(
            node
        ):
            node.body = node.body[1:] or [ast.Pass()]
        return super().generic_visit(node)
