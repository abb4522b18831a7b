"""Text from the bytes of a file: by its byte order mark, else as UTF-8 if valid, else as chardet detects it."""

import codecs
import re

from bridge.faults import Fault

# longest first: the mark of UTF-32 begins with the mark of UTF-16
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
_SIGNS = set("µ°²³·±–−×Ω§")  # signs of units alone show no language, so chardet cannot detect an encoding by them
_INSIDE = re.compile(
    r"[A-Za-z][µ°²³±−–Ω§][A-Za-z]"
)  # a sign inside of a word is a letter of another encoding: `Si³a` is Siła
_OTHER = re.compile(rb"[^\r\n]*[\x80-\xff][^\r\n]*")
_LINES = 50  # lines with other letters than ASCII that chardet sees; the numbers of the rows would only make it unsure
_LOOKED_AT = 4096  # first bytes, which reveal UTF-16 without a mark: every other byte of western text is 0


def decoded(data: bytes, encoding: str | None, file: str) -> tuple[str, str]:
    """The text of a file without its mark, and its encoding.

    Raises Fault BAD_TABLE if Python does not know `encoding`, which a map states, or if it does not fit the bytes.
    """
    marked = next(((mark, name) for mark, name in _MARKS if data.startswith(mark)), None)
    if marked is not None:
        data = data[len(marked[0]) :]
        encoding = marked[1]
    if encoding is not None:
        try:
            return data.decode(encoding), encoding
        except UnicodeDecodeError as error:
            line = data[: error.start].count(b"\n") + 1
            text = f"{file}: line {line}: is not {encoding}: {error.reason} at byte {error.start + 1}"
            raise Fault(
                "BAD_TABLE", f"{text}; leave source.encoding out, or state another (with `look`: --encoding)"
            ) from None
        except LookupError:
            line = f"source.encoding = {encoding!r}: unknown to Python; leave it out, or try latin-1"
            raise Fault("BAD_TABLE", line) from None
    if wide := wide_encoding(data[:_LOOKED_AT]):
        return data.decode(wide, errors="replace"), wide
    try:
        return data.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        encoding = _detected(data)
        return data.decode(encoding, errors="replace"), encoding


def wide_encoding(start: bytes) -> str:
    """The encoding of a text in UTF-16 or UTF-32 from its first bytes; empty for other files."""
    marked = next((name for mark, name in _MARKS if start.startswith(mark)), "")
    if marked:
        return marked if marked != "utf-8" else ""
    even, odd = start[::2].count(0), start[1::2].count(0)
    # most letters of a western text have one byte of 0, always at the same side
    if max(even, odd) <= len(start) // 4 or min(even, odd) > len(start) // 64:
        return ""
    return "utf-16-le" if odd > even else "utf-16-be"


def _detected(data: bytes) -> str:
    """The encoding that chardet finds in the lines with other letters than ASCII; Windows-1252 for signs of units alone."""
    from chardet import EncodingEra, detect

    lines: list[bytes] = []
    for line in _OTHER.finditer(data):
        lines.append(line[0])
        if len(lines) == _LINES:
            break
    text = b"\n".join(dict.fromkeys(lines))
    western = text.decode("cp1252", errors="replace")
    if {letter for letter in western if not letter.isascii()} <= _SIGNS and not _INSIDE.search(western):
        return "cp1252"
    likely = detect(text, encoding_era=EncodingEra.MODERN_WEB)["encoding"]
    # many encodings share these letters: the usual one of them is reported
    return codecs.lookup(likely).name if likely and text.decode(likely, errors="replace") != western else "cp1252"
