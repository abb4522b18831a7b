"""The header of every run log of this project, for writer and reader alike."""

import struct

from bridge.faults import Fault
from bridge.wire.payloads import READABLE_VERSIONS, SCHEMA_VERSION

MAGIC = b"\x89MCAP0\r\n"  # first and last bytes of every MCAP file
HEAD = struct.Struct("<BQ")  # begin of every record: opcode, length of the content
_OURS = "stickslip schema "
LIBRARY = f"{_OURS}{SCHEMA_VERSION}"  # program name in the header of the file
READABLE = tuple(f"{_OURS}{version}" for version in READABLE_VERSIONS)


def refuse_other_version(path: object, library: str) -> None:
    """Raise Fault BAD_LOG for a log of another schema version of this project; other programs' library names are accepted."""
    if library.startswith(_OURS) and library not in READABLE:
        known = " or ".join(map(repr, READABLE))
        line = f"{path}: written by {library!r}: must be {known}; use the version of stickslip that wrote it"
        raise Fault("BAD_LOG", line)
