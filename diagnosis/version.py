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
NOT_JUDGED = ("diagnosis/version.py", "diagnosis/report", "diagnosis/pictures", "plant/app.py", "plant/node.py")
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
    tree = ast.parse(path.read_text(encoding="utf-8"))
    for statement in _without_docstring(tree.body):
        if not isinstance(statement, ast.Import | ast.ImportFrom):
            yield _canonical(statement)


def _without_docstring(body: list[ast.stmt]) -> list[ast.stmt]:
    first = body[0] if body else None
    text = isinstance(first, ast.Expr) and isinstance(first.value, ast.Constant) and isinstance(first.value.value, str)
    return body[1:] if text else body


def _canonical(node: ast.AST) -> str:
    """A syntax tree as text without empty fields, as every version of Python adds some of these."""
    parts: list[str] = []
    definition = isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef | ast.ClassDef)
    for name, field in ast.iter_fields(node):
        value = _without_docstring(field) if definition and name == "body" else field
        if isinstance(node, ast.Call) and name == "keywords":
            value = [keyword for keyword in node.keywords if keyword.arg not in _NOT_JUDGED_KEYWORDS]
        if value not in (None, []):
            parts.append(f"{name}={_text(value)}")
    return f"{type(node).__name__}({', '.join(parts)})"


def _text(value: object) -> str:
    if isinstance(value, ast.AST):
        return _canonical(value)
    if isinstance(value, list):
        return "[" + ", ".join(_text(item) for item in value) + "]"  # pyright: ignore[reportUnknownVariableType]
    return repr(value)
