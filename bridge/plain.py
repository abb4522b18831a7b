"""Text from files, safe for a terminal: control characters are written as their codes."""

import re
import sys
from collections.abc import Callable

# C0 except tab and newline, DEL, C1, and invisible characters or marks of writing direction: they can hide or forge text, and an
# escape code can rename the window or type input
_CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]")

# Begin of a line on stderr of a process that waits for a compilation; its parent prints it too.
ANOTHER_COMPILES = "another process compiles the kernels of "


def plain(text: str) -> str:
    """The text with control and invisible characters as their codes."""
    return _CONTROL.sub(lambda match: match[0].encode("unicode_escape").decode(), text)


def print_line(line: str) -> None:
    """Print a line on stderr, plain."""
    print(plain(line), file=sys.stderr, flush=True)


# Reports a step in the life of a process: its name (waiting, joined, running, ended) and a text.
StepReport = Callable[[str, str], None]


def no_report(_step: str, _text: str) -> None:
    """Discard the report."""
