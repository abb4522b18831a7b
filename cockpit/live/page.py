"""The live page: one self-contained HTML file, assembled when the server starts."""

import base64
import hashlib
import re
from pathlib import Path

from cockpit.live.gate import NAMES
from cockpit.review.page import page_of_curves, text_of

_FOLDER = Path(__file__).parent
_SCRIPTS = ("store.js", "state.js", "scope.js", "command.js", "live.js")
_NO_ICON = '<link rel="icon" href="data:,">\n'  # an empty icon, so that the browser requests none


class Page:
    """The page as bytes, with its content security policy.

    Args:
        port: port of the server.

    """

    def __init__(self, port: int) -> None:
        body = text_of(_FOLDER / "live.html")
        page = page_of_curves("stickslip: waiting", body, _NO_ICON, [_FOLDER / name for name in _SCRIPTS])
        self.body = page.encode()
        # only the scripts of this page may run, and the page may connect to this server only
        scripts = re.findall(r"<script>(.*?)</script>", page, re.DOTALL)
        hashes = " ".join(f"'sha256-{_sha256(script)}'" for script in scripts)
        streams = " ".join(f"ws://{name}:{port}" for name in NAMES)
        self.policy = (
            f"default-src 'none'; script-src {hashes}; style-src 'unsafe-inline'; img-src data:; connect-src {streams}; "
            "frame-ancestors 'none'; base-uri 'none'; form-action 'none'"
        )


def _sha256(text: str) -> str:
    return base64.b64encode(hashlib.sha256(text.encode()).digest()).decode()
