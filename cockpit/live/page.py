"""The live page: one self-contained HTML file, assembled when the server starts."""

import base64
import hashlib
import re
from pathlib import Path

from cockpit.live.gate import NAMES
from cockpit.review.page import SHARED_SCRIPTS, filled, text_of, uplot

_FOLDER = Path(__file__).parent
_SCRIPTS = ("store.js", "state.js", "scope.js", "live.js")


class Page:
    """The page as bytes, with its content security policy.

    Args:
        port: of the server.

    """

    def __init__(self, port: int) -> None:
        parts = {
            "STYLE": "\n".join([text_of("vendor/uPlot.min.css"), text_of("page.css"), _file_text("live.css")]),
            "UPLOT": uplot(),
            "SCRIPT": "\n".join([*map(text_of, SHARED_SCRIPTS), *map(_file_text, _SCRIPTS)]),
        }
        page = filled(_file_text("live.html"), parts)
        self.body = page.encode()
        # only the scripts of this page may run, and the page may connect to this server only
        scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
        hashes = " ".join(f"'sha256-{_sha256(script)}'" for script in scripts)
        streams = " ".join(f"ws://{name}:{port}" for name in NAMES)
        self.policy = (
            f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:; connect-src {streams}; "
            "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
        )


def _file_text(name: str) -> str:
    return (_FOLDER / name).read_text(encoding="utf-8")


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
