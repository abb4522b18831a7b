"""Counts that may only fall: phrases of the house dialect, lines of Python, words of Markdown.

`python -m tests.ratchet` lowers the limits in `tests/unit/ratchet.toml` to the counts of this tree and prints both.
"""

import ast
import io
import math
import re
import subprocess
import tokenize
import tomllib
from collections import defaultdict
from collections.abc import Iterator
from pathlib import Path

ROOT = Path(__file__).parent.parent
LIMITS = ROOT / "tests/unit/ratchet.toml"
_PACKAGES = ("bridge", "controller", "plant", "diagnosis", "cockpit", "bench")
_PHRASES = (
    r"told|tells?|say|says|said|obeys?|obeyed|owes?|owed|minds?|a person(?:'s)?|persons|strangers?|nobody|somebody|what"
    r"|(?:is|are) (?:none|no \w+)|stands?|stood|but (?:for|of)|of (?:its|their) own|anew|beside|meanwhile|hardly|surely"
    r"|(?:that|those) of|(?:comes?|came) (?:to|of|again)|as it (?:is|was)|one that"
)
_DIALECT = re.compile(rf"\b(?:{_PHRASES})\b", re.IGNORECASE)
_NAME = re.compile(r"_?(?:one|some|told|found|said|own|there|here)")
_FENCED = re.compile(r"^(```|~~~).*?^\1|`[^`\n]*`", re.MULTILINE | re.DOTALL)
_HEADER = """\
# Counts of `python -m tests.ratchet`, which lowers them. A commit that raises one gives the reason in its message.
# prose, messages, markdown: phrases of the dialect per 1000 words; names: vague identifiers per 1000 lines.
"""


def _tracked(pattern: str) -> list[Path]:
    listed = subprocess.run(
        ["git", "ls-files", "-z", pattern], cwd=ROOT, capture_output=True, check=True
    ).stdout.decode()
    return [ROOT / name for name in listed.split("\0") if name and (ROOT / name).is_file()]


def _of_python(source: str) -> tuple[list[str], list[str], int]:
    """Comments and docstrings; texts of three words or more; the number of vague names that are bound."""
    tree = ast.parse(source)
    prose = [
        token.string
        for token in tokenize.generate_tokens(io.StringIO(source).readline)
        if token.type == tokenize.COMMENT
    ]
    docstrings: set[ast.AST] = set()
    messages: list[str] = []
    names = 0
    for node in ast.walk(tree):  # a docstring's parent comes before it
        if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef | ast.AsyncFunctionDef):
            if (text := ast.get_docstring(node)) and isinstance(node.body[0], ast.Expr):
                prose.append(text)
                docstrings.add(node.body[0].value)
        elif isinstance(node, ast.Constant):
            if isinstance(node.value, str) and node.value.count(" ") > 1 and node not in docstrings:
                messages.append(node.value)
        elif isinstance(node, ast.Name) and isinstance(node.ctx, ast.Store):
            names += bool(_NAME.fullmatch(node.id))
        elif isinstance(node, ast.arg):
            names += bool(_NAME.fullmatch(node.arg))
    return prose, messages, names


def _rate(texts: list[str]) -> float:
    """Phrases per 1000 words, rounded up to 0.1."""
    words = sum(len(text.split()) for text in texts)
    return math.ceil(1e4 * sum(len(_DIALECT.findall(text)) for text in texts) / max(words, 1)) / 10


def _folders(path: Path) -> Iterator[str]:
    """The top folder of a file, and the folder below it; "." holds the README and the pages next to it."""
    parts = path.relative_to(ROOT).parts
    yield parts[0] if len(parts) > 1 else "."
    if len(parts) > 2:
        yield "/".join(parts[:2])


def counts() -> dict[str, dict[str, float]]:
    """Tables of `ratchet.toml`: per folder the rates of the dialect, lines of Python and words of Markdown.

    Raises:
        CalledProcessError: this is not a clone of the repository.

    """
    prose, messages, pages = (defaultdict[str, list[str]](list) for _ in range(3))
    names, lines, words = (defaultdict[str, int](int) for _ in range(3))
    for path in _tracked("*.py"):
        source = path.read_text(encoding="utf-8")
        top, *below = _folders(path)
        if path.name.endswith("_pb2.py"):
            continue
        lines[top] += source.count("\n")
        found = _of_python(source)
        for folder in (top, *below) if top in _PACKAGES else (top,):
            prose[folder] += found[0]
            if top in _PACKAGES:
                messages[folder] += found[1]
                names[folder] += found[2]
    for path in _tracked("*.md"):
        text = path.read_text(encoding="utf-8")
        words["all"] += len(text.split())
        for folder in _folders(path):
            pages[folder].append(_FENCED.sub("", text))
    python = {top: lines[top] for top in sorted(lines)}
    return {
        "prose": {folder: _rate(texts) for folder, texts in sorted(prose.items())},
        "messages": {folder: _rate(texts) for folder, texts in sorted(messages.items())},
        "names": {top: math.ceil(1e4 * names[top] / lines[top]) / 10 for top in _PACKAGES},
        "markdown": {folder: _rate(texts) for folder, texts in sorted(pages.items())},
        "python_lines": dict(python),
        "markdown_words": dict(words),
    }


def limits() -> dict[str, dict[str, float]]:
    return tomllib.loads(LIMITS.read_text(encoding="utf-8"))


def main() -> None:
    now, before = counts(), limits() if LIMITS.is_file() else {}
    text = _HEADER
    for table, rows in now.items():
        text += f"\n[{table}]\n"
        for folder, count in rows.items():
            limit = before.get(table, {}).get(folder, count)
            print(f"{table:15} {folder:28} {count:9g}   limit {limit:g}")
            text += f'"{folder}" = {min(count, limit):g}\n'
    LIMITS.write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
