"""Hooks of `mkdocs build`: whole folders in the navigation, and files from outside of docs/.

A page links `../../bridge/wire/PROTOCOL.md`, which is right on the host and in an editor; on the site that file is the page
`reference/protocol.md`.
"""

import os
import re
from pathlib import Path, PurePosixPath
from typing import Any

from mkdocs.structure.files import File, Files

ROOT = Path(__file__).parent.parent
# file of the site: file of the repository
PAGES = {
    "reference/protocol.md": "bridge/wire/PROTOCOL.md",
    "contributing.md": "CONTRIBUTING.md",
    "changelog.md": "CHANGELOG.md",
    "reference/stickslip.proto": "bridge/wire/stickslip.proto",
}
_TARGET = re.compile(r"(?<=\]\()([^)#\s:]+)(?=[)#])")  # a relative target of a link, without its anchor


def on_config(config: Any) -> Any:
    """Put all pages of a folder in the place of `FOLDER/` in the navigation: the index, then by number or name."""
    for section in config.nav:
        for title, value in section.items():
            if isinstance(value, str) and value.endswith("/"):
                section[title] = [f"{value}{name}" for name in sorted(os.listdir(ROOT / "docs" / value), key=_order)]
    return config


def _order(name: str) -> tuple[bool, int, str]:
    number = re.match(r"\d+", name)
    return name != "index.md", int(number[0]) if number else 0, name


def on_files(files: Files, config: Any) -> Files:
    """Add the files that lie outside docs/."""
    for page, source in PAGES.items():
        files.append(File.generated(config, page, abs_src_path=str(ROOT / source)))
    return files


def on_page_markdown(markdown: str, page: Any, **_: Any) -> str:
    """Point every relative link at its page of the site."""
    place = PurePosixPath(page.file.src_uri)
    source = PurePosixPath(PAGES.get(str(place), f"docs/{place}"))
    pages = {file: page for page, file in PAGES.items()} | {"README.md": "index.md"}

    def on_site(match: re.Match[str]) -> str:
        file = os.path.normpath(source.parent / match[1])
        to = pages.get(file) or file.removeprefix("docs/")
        return os.path.relpath(to, place.parent)

    return _TARGET.sub(on_site, markdown)
