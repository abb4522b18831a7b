"""Text from the bytes of a file: by its byte order mark, else as UTF-8 if valid, else as Windows-1252."""

import codecs

from bridge.faults import Fault

# longest first: the mark of UTF-32 begins with the mark of UTF-16
_MARKS = (
    (codecs.BOM_UTF32_LE, "utf-32-le"),
    (codecs.BOM_UTF32_BE, "utf-32-be"),
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)
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
            raise Fault("BAD_TABLE", f"{text}; leave source.encoding out, or state another") from None
        except LookupError:
            line = f"source.encoding = {encoding!r}: unknown to Python; leave it out, or try latin-1"
            raise Fault("BAD_TABLE", line) from None
    start = data[:_LOOKED_AT]
    if start.count(0) > len(start) // 4:
        wide = "utf-16-le" if start[1::2].count(0) > start[::2].count(0) else "utf-16-be"
        return data.decode(wide, errors="replace"), wide
    try:
        return data.decode("utf-8"), "utf-8"
    except UnicodeDecodeError:
        return data.decode("cp1252", errors="replace"), "cp1252"
