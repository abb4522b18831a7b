"""What every run log of this project begins with, for its writer and its reader alike."""

import struct

from bridge.wire.payloads import READABLE_VERSIONS, SCHEMA_VERSION

MAGIC = b"\x89MCAP0\r\n"  # of every MCAP file, at its beginning and at its end
HEAD = struct.Struct("<BQ")  # of every record: opcode, length of what follows
LIBRARY = f"stickslip schema {SCHEMA_VERSION}"  # in the header of the file
READABLE = tuple(f"stickslip schema {version}" for version in READABLE_VERSIONS)
