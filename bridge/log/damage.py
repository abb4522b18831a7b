"""What of a log could not be read: counted by a reader, told as findings."""

from pathlib import Path
from typing import NamedTuple

from bridge.log.finding import Finding
from bridge.units import counted


class Damage(NamedTuple):
    """The parts of a log that could not be read."""

    cut_bytes: int  # from the first record that is not whole to the end of the file
    bad_chunks: int  # number of whole chunks with a wrong checksum
    closed: bool  # the file has its footer
    bad_records: int = 0  # number of definitions, tables, messages or stretches of bytes that cannot be read

    @property
    def whole(self) -> bool:
        """Whether the log was closed and everything in it could be read."""
        return self.closed and not (self.cut_bytes or self.bad_chunks or self.bad_records)


def damage_findings(damage: Damage, path: Path) -> list[Finding]:
    """A finding for each kind of loss in a log."""
    found: list[Finding] = []
    remedy = f"`stickslip log recover {path}` saves the rest"
    if not damage.closed:
        text = f"has no end, {damage.cut_bytes} bytes of an open chunk were lost; {remedy}"
        found.append(Finding("cut", path.name, text, max(damage.cut_bytes, 1)))
    if damage.bad_chunks:
        found.append(
            Finding(
                "damaged",
                path.name,
                f"{counted(damage.bad_chunks, 'chunk is', 'chunks are')} damaged; {remedy}",
                damage.bad_chunks,
            )
        )
    if damage.bad_records:
        text = f"{damage.bad_records} definitions, messages or stretches of bytes make no sense; {remedy}"
        found.append(Finding("damaged", path.name, text, damage.bad_records))
    return found
