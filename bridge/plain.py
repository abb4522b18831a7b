"""Text from files as a terminal may show it: what could command the terminal is written out instead."""

import re
import sys
from collections.abc import Callable

# C0 but for tab and the line's end, DEL, C1, and the marks that turn the direction of writing or cannot be seen: each can hide or
# forge what a person reads, and an escape code can do more (rename the window, answer in the person's name)
_COMMANDS = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u200b-\u200f\u2028-\u202e\u2060-\u2069\ufeff]")

# Lines on stderr that the parent of a process reads. It waits for a compilation:
ANOTHER_COMPILES = "another process compiles the kernels of "
# it has loaded all that it needs, and waits for the other processes:
LOADED = "loaded"


def plain(text: str) -> str:
    """The text with every control character as its number in hexadecimal."""
    return _COMMANDS.sub(lambda found: found[0].encode("unicode_escape").decode(), text)


def say(line: str) -> None:
    """Print a line on stderr, plain."""
    print(plain(line), file=sys.stderr, flush=True)


# What a process tells a person of its life: what (waiting, joined, running, ended) and a text.
Tell = Callable[[str, str], None]


def untold(_what: str, _text: str) -> None:
    """Nobody looks."""
