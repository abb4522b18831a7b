"""The constants by which the diagnosis decides, read from its source: value, effect, page of the count."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[1]
_ROOMS = ("gap", "hypotheses", "fits", "relations", "latent", "judge")  # of diagnosis/, in the order of the work
_LONGEST = 60  # of a value that is written out: a longer expression is a table and not a number
_COUNTED = re.compile(r"docs/method/([a-z-]+)\.md")


class Constant(NamedTuple):
    """A number, or a few, that decides something."""

    file: str
    name: str
    value: str
    note: str
    counted: str


def constants() -> Iterator[Constant]:
    """Of every module of the rooms, in the order of the source."""
    for room in _ROOMS:
        for path in sorted((ROOT / "diagnosis" / room).glob("*.py")):
            yield from _of_module(path)


def sections() -> Iterator[tuple[str, list[list[str]]]]:
    """Each room with the cells of its rows."""
    for room in _ROOMS:
        rows = [row for row in constants() if row.file.startswith(f"{room}/")]
        yield room, [[f"`{row.name}`", row.file, f"`{row.value}`", row.note, row.counted] for row in rows]


def _of_module(path: Path) -> Iterator[Constant]:
    text = path.read_text(encoding="utf-8")
    lines = text.splitlines()
    file = f"{path.parent.name}/{path.name}"
    method = {page.stem: page.read_text(encoding="utf-8") for page in sorted((ROOT / "docs" / "method").glob("*.md"))}
    for node in ast.parse(text).body:
        target, value = _assigned(node)
        if target is None or value is None or not _is_number(value):
            continue
        note = _comment(lines, node.lineno - 1, node.end_lineno or node.lineno)
        names = [name.id for name in ast.walk(target) if isinstance(name, ast.Name)]
        pages = {*_COUNTED.findall(note), *(page for page, body in method.items() if _counts(body, names, path.name))}
        counted = ", ".join(f"[{page}](../method/{page}.md)" for page in sorted(pages))
        yield Constant(file, ", ".join(names), ast.unparse(value), note, counted)


def _counts(page: str, names: list[str], module: str) -> bool:
    """Whether a page has a heading on one of the constants, below the heading of the module."""
    for part in re.split(r"^## ", page, flags=re.MULTILINE)[1:]:
        if part.startswith(f"{module}\n"):
            heads = re.findall(r"^### (.*)$", part, flags=re.MULTILINE)
            return any(re.search(rf"(?<![A-Z_]){re.escape(name)}(?![A-Z_])", head) for head in heads for name in names)
    return False


def _assigned(node: ast.stmt) -> tuple[ast.expr | None, ast.expr | None]:
    if isinstance(node, ast.Assign) and len(node.targets) == 1:
        target, value = node.targets[0], node.value
    elif isinstance(node, ast.AnnAssign):
        target, value = node.target, node.value
    else:
        return None, None
    names = [name_node.id for name_node in ast.walk(target) if isinstance(name_node, ast.Name)]
    return (target, value) if all(name.upper() == name for name in names) else (None, None)


def _is_number(value: ast.expr) -> bool:
    """Whether a value is a number, a few numbers, or an expression of them, and short enough to be read."""
    leaves = [leaf for leaf in ast.walk(value) if isinstance(leaf, ast.Constant)]
    texts = any(isinstance(leaf.value, str) for leaf in leaves)
    names = {leaf.id for leaf in ast.walk(value) if isinstance(leaf, ast.Name)}
    numbers = any(isinstance(leaf.value, (int, float)) and not isinstance(leaf.value, bool) for leaf in leaves)
    return numbers and not texts and names <= {"math", "np", "KNEE"} and len(ast.unparse(value)) <= _LONGEST


def _comment(lines: list[str], first: int, end: int) -> str:
    """The comment behind an assignment, or the block above it."""
    behind = [line.split("  # ", 1)[1] for line in lines[first:end] if "  # " in line]
    above: list[str] = []
    for line in reversed(lines[:first]):
        if not line.startswith("# "):
            break
        above.insert(0, line.removeprefix("# "))
    return " ".join([*above, *behind]).strip()
