"""Links lead somewhere, named files exist, and the pages that `make docs` generates can be generated."""

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

from docs import generate, readme, zenoh_files

ROOT = Path(__file__).parent.parent.parent
_OUTSIDE = ("README.md", "CONTRIBUTING.md", "CHANGELOG.md", "bridge/wire/PROTOCOL.md")
GENERATED = {generate.FOLDER / name: text for name, text in generate.pages().items()}  # not in git
KEPT = sorted({*(ROOT / name for name in _OUTSIDE), *(ROOT / "docs").rglob("*.md")} - GENERATED.keys())
PAGES = sorted((*KEPT, *GENERATED))
_LINK = re.compile(r"\]\(([^)\s]+)\)")
_CODE = re.compile(r"^(```|~~~).*?^\1", re.MULTILINE | re.DOTALL)
# of folders of the repository; `deploy/rigs/*.toml` is one, `runs/demo.mcap` is not
_FILE = re.compile(r"`((?:bridge|controller|plant|diagnosis|cockpit|deploy|docs|tests)/[\w./*-]+)`")


def _name(page: Path) -> str:
    return str(page.relative_to(ROOT))


def _text(page: Path) -> str:
    return GENERATED.get(page) or page.read_text(encoding="utf-8")


def _anchors(page: Path) -> Iterator[str]:
    """Anchors of a page's headings, as the host and mkdocs make them, and those that are written out."""
    text = _CODE.sub("", _text(page))
    for heading in re.findall(r"^#+ (.+)$", text, re.MULTILINE):
        plain = re.sub(r"\[([^]]*)]\([^)]*\)", r"\1", heading).lower()
        yield re.sub(r"\s+", "-", re.sub(r"[^\w\s-]", "", plain).strip())
    yield from re.findall(r'id="([^"]+)"', text)


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_links_lead_somewhere(page: Path) -> None:
    dead: list[str] = []
    for link in _LINK.findall(_CODE.sub("", _text(page))):
        if re.match(r"[a-z]+:", link):
            continue
        file, _, anchor = link.partition("#")
        target = (page.parent / file).resolve() if file else page
        exists = target in GENERATED or target.is_file()
        if not exists or (anchor and anchor not in _anchors(target)):
            dead.append(link)
    assert not dead


@pytest.mark.parametrize("page", [page for page in KEPT if page != ROOT / "docs/index.md"], ids=_name)
def test_pages_of_a_checkout_link_to_no_generated_page(page: Path) -> None:
    """Only `make docs` makes these pages, and with them the site, whose first page is docs/index.md."""
    links = _LINK.findall(_text(page))
    assert not [link for link in links if (page.parent / link.partition("#")[0]).resolve() in GENERATED]


@pytest.mark.parametrize("page", PAGES, ids=_name)
def test_named_files_exist(page: Path) -> None:
    named = set(_FILE.findall(_text(page)))
    assert not [page for page in sorted(named) if not any(ROOT.glob(page.rstrip("/")))]


def test_pages_that_the_code_names_exist() -> None:
    sources = [
        path
        for name in ("bridge", "controller", "plant", "diagnosis", "cockpit", "tests")
        for path in (ROOT / name).rglob("*.py")
    ]
    named = {page for path in sources for page in re.findall(r"\bdocs/[\w/-]+\.md", path.read_text(encoding="utf-8"))}
    assert not [page for page in sorted(named) if not (ROOT / page).is_file()]


def test_generated_pages_are_not_in_git() -> None:
    ignored = (ROOT / ".gitignore").read_text(encoding="utf-8").splitlines()
    assert {f"docs/reference/{page.name}" for page in GENERATED} <= set(ignored)


def test_the_documented_zenoh_configurations_match_the_code() -> None:
    made = zenoh_files.configurations()
    assert {path.name for path in zenoh_files.FOLDER.glob("*.json5")} == made.keys()
    assert not [name for name, text in made.items() if (zenoh_files.FOLDER / name).read_text() != text], (
        "make reference"
    )


def test_readme_is_a_landing_page() -> None:
    text = (ROOT / "README.md").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 66
    assert len(text.split()) <= 660


def test_readme_shows_the_output_of_its_commands() -> None:
    text = readme.README.read_text(encoding="utf-8")
    kept = readme.KEPT.read_text(encoding="utf-8")
    assert re.findall(r"^\$ (.*)$", kept, re.MULTILINE) == readme.commands(text)
    assert f"\n\n{readme.block(kept)}\n\n" in text, "make readme"
    (number,) = re.findall(r"^effect: .*: (damping .*?\))", kept, re.MULTILINE)
    assert number in (ROOT / "docs/start/first-diagnosis.md").read_text(encoding="utf-8")


@pytest.mark.parametrize("package", ["bridge", "controller", "plant", "diagnosis", "cockpit", "bench", "deploy"])
def test_contributing_names_the_folders_that_there_are(package: str) -> None:
    text = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
    (row,) = re.findall(rf"^    {package}/ (.*(?:\n     .*)*)", text, re.MULTILINE)
    folders = {path.parent.name for path in (ROOT / package).glob("*/*") if path.parent.name != "__pycache__"}
    assert set(re.findall(r"(\w+)/", row)) == folders


def test_contributing_names_commands_that_there_are() -> None:
    named = set(re.findall(r"`make ([a-z-]+)`", (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")))
    made = re.findall(r"^([a-z-]+):", (ROOT / "Makefile").read_text(encoding="utf-8"), re.MULTILINE)
    assert named <= set(made)


def test_every_decision_has_its_four_headings() -> None:
    for page in (ROOT / "docs/decisions").glob("[0-9]*.md"):
        headings = re.findall(r"^## (.+)$", page.read_text(encoding="utf-8"), re.MULTILINE)
        assert headings == ["Problem", "Decision", "Alternatives", "Revisit when"], page.name


def _packages() -> list[Path]:
    tops = ("bridge", "controller", "plant", "diagnosis", "cockpit", "bench")
    return [init for top in tops for init in sorted((ROOT / top).rglob("__init__.py"))]


@pytest.mark.parametrize("init", _packages(), ids=lambda init: _name(init.parent))
def test_the_note_of_a_package_names_its_folders_and_modules(init: Path) -> None:
    note = ast.get_docstring(ast.parse(init.read_text(encoding="utf-8"))) or ""
    folders = {path.parent.name for path in init.parent.glob("*/__init__.py")}
    modules = {path.stem for path in init.parent.glob("*.py")} - {"__init__", "__main__", "stickslip_pb2"}
    assert not {f"{name}/" for name in folders} - set(re.findall(r"\w+/", note))
    assert not modules - set(re.findall(r"\w+", note))
    rows = re.findall(r"^(\w+(?:, \w+)*/?) {2,}", note, re.MULTILINE)
    assert not {name for row in rows for name in row.rstrip("/").split(", ")} - folders - modules
