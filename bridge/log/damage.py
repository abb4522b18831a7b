"""Parts of a log that could not be read: counted by the reader, reported as findings."""

from pathlib import Path
from typing import NamedTuple

from bridge.log.finding import Finding, findings_at
from bridge.units import counted

_COUNTS = ("cut_bytes", "bad_chunks", "bad_records", "nameless", "missing")
_MOST_TOPICS = 4  # topics of other programs that the message names

CHANGED = "its bytes were changed after writing"  # in Damage.before


class Damage(NamedTuple):
    """The parts of a log that could not be read."""

    cut_bytes: int  # length of the file's end from the first incomplete record on
    bad_chunks: int  # number of whole chunks with a wrong checksum
    closed: bool  # the file has its footer
    bad_records: int = 0  # number of definitions, tables, messages or stretches of bytes that cannot be read
    nameless: int = 0  # messages of a channel whose definition is lost: their topic cannot be known
    missing: int = 0  # messages that the file's statistics count but that were not read
    before: str = ""  # earlier losses of the log that this log was recovered from, as text
    first_bad: str = ""  # fault of the first complete message that cannot be read

    @property
    def whole(self) -> bool:
        """Whether the log was closed and everything in it could be read."""
        return self.closed and not any(getattr(self, name) for name in _COUNTS)

    def and_also(self, **more: int) -> "Damage":
        """The damage with counts added to the given fields."""
        return self._replace(**{name: getattr(self, name) + count for name, count in more.items()})


def of_all_files(damages: list[Damage]) -> Damage:
    """The damage of a log of several files."""
    counts = {name: sum(getattr(damage, name) for damage in damages) for name in _COUNTS}
    before = "; ".join(damage.before for damage in damages if damage.before)
    first_bad = next((damage.first_bad for damage in damages if damage.first_bad), "")
    return Damage(**counts, closed=all(damage.closed for damage in damages), before=before, first_bad=first_bad)


def also_before(damage: Damage, lost: str) -> Damage:
    """The damage with an earlier loss of the log, a text from the file; a known one is not repeated."""
    known = damage.before.split("; ") if damage.before else []
    return damage if not lost or lost in known else damage._replace(before="; ".join([*known, lost]))


def lost_in_words(damage: Damage) -> str:
    """The losses as text; empty for a log without losses."""
    parts = [f"{counted(damage.cut_bytes, 'byte')} at the end"] if damage.cut_bytes else []
    parts += [counted(damage.bad_chunks, "damaged chunk")] if damage.bad_chunks else []
    if damage.bad_records:
        names = "damaged definition, message or stretch", "damaged definitions, messages or stretches"
        parts.append(counted(damage.bad_records, *names))
    if damage.nameless:
        parts.append(f"{counted(damage.nameless, 'message')} whose topic is lost with its definition")
    if damage.missing:
        parts.append(f"{counted(damage.missing, 'message')} in its statistics, but not read")
    parts += ["its end"] if not (parts or damage.whole) else []
    return ", ".join(parts)


def damage_findings(damage: Damage, path: Path) -> list[Finding]:
    """A finding for each kind of loss in a log."""
    remedy = f"`stickslip log recover {path}` saves the rest"
    cut, cut_bytes = 0 if damage.closed else max(damage.cut_bytes, 1), counted(damage.cut_bytes, "byte")
    chunks = counted(damage.bad_chunks, "chunk is", "chunks are")
    first = f", first: {damage.first_bad}" if damage.first_bad else ""
    nonsense = f"{damage.bad_records} definitions, messages or stretches of bytes cannot be read{first}"
    whose = counted(damage.nameless, "message belongs", "messages belong")
    more = counted(damage.missing, "message")
    before = f"was recovered from a damaged log; the number of missing messages is not known: {damage.before}"
    rows = (
        ("cut", cut, f"has no valid end; {cut_bytes} after its last whole record cannot be read; {remedy}"),
        ("damaged", damage.bad_chunks, f"{chunks} damaged; {remedy}"),
        ("damaged", damage.bad_records, f"{nonsense}; {remedy}"),
        ("damaged", damage.nameless, f"{whose} to a channel whose definition is lost: the topic cannot be known"),
        ("damaged", damage.missing, f"the file's statistics count {more} more than the file holds"),
        ("recovered", int(bool(damage.before)), before),
    )
    return findings_at(path.name, rows)


def foreign_in_words(foreign: dict[str, int]) -> list[str]:
    """One line on the skipped messages of other programs; empty without such a message."""
    if not foreign:
        return []
    names = [topic or "a topic without a name" for topic in foreign]
    named = ", ".join(names[:_MOST_TOPICS]) + (
        f" and {len(names) - _MOST_TOPICS} more" if len(names) > _MOST_TOPICS else ""
    )
    return [f"{counted(sum(foreign.values()), 'message')} of other programs skipped: {named}"]
