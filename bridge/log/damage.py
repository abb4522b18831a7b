"""Parts of a log that could not be read: counted by the reader, reported as findings."""

from pathlib import Path
from typing import NamedTuple

from bridge.log.finding import Finding
from bridge.units import counted

_MOST_TOPICS = 4  # of other programs that are named


class Damage(NamedTuple):
    """The parts of a log that could not be read."""

    cut_bytes: int  # from the first record that is not whole to the end of the file
    bad_chunks: int  # number of whole chunks with a wrong checksum
    closed: bool  # the file has its footer
    bad_records: int = 0  # number of definitions, tables, messages or stretches of bytes that cannot be read
    nameless: int = 0  # messages of a channel whose definition is lost: their topic cannot be known
    missing: int = 0  # messages that the file's own count has and that were not found
    before: str = ""  # earlier losses of the log that this log was recovered from, as text
    first_bad: str = ""  # why the first message that is whole cannot be read

    @property
    def whole(self) -> bool:
        """Whether the log was closed and everything in it could be read."""
        lost = (self.cut_bytes, self.bad_chunks, self.bad_records, self.nameless, self.missing)
        return self.closed and not any(lost)

    def and_also(self, **more: int) -> "Damage":
        """Add counts to the given fields."""
        return self._replace(**{name: getattr(self, name) + count for name, count in more.items()})


def also_before(damage: Damage, lost: str) -> Damage:
    """Add an earlier loss, in the words of the file."""
    known = damage.before.split("; ") if damage.before else []
    return damage if not lost or lost in known else damage._replace(before="; ".join([*known, lost]))


def lost_in_words(damage: Damage) -> str:
    """The losses as text; empty for a log without losses."""
    parts = [f"{counted(damage.cut_bytes, 'byte')} of an open chunk at the end"] if damage.cut_bytes else []
    parts += [counted(damage.bad_chunks, "damaged chunk")] if damage.bad_chunks else []
    if damage.bad_records:
        names = "damaged definition, message or stretch", "damaged definitions, messages or stretches"
        parts.append(counted(damage.bad_records, *names))
    if damage.nameless:
        parts.append(f"{counted(damage.nameless, 'message')} whose topic is lost with its definition")
    if damage.missing:
        parts.append(f"{counted(damage.missing, 'message')} by the log's own count")
    parts += ["its end"] if not (parts or damage.whole) else []
    return ", ".join(parts)


def damage_findings(damage: Damage, path: Path) -> list[Finding]:
    """A finding for each kind of loss in a log."""
    findings: list[Finding] = []
    remedy = f"`stickslip log recover {path}` saves the rest"
    if not damage.closed:
        text = f"has no end, {damage.cut_bytes} bytes of an open chunk were lost; {remedy}"
        findings.append(Finding("cut", path.name, text, max(damage.cut_bytes, 1)))
    if damage.bad_chunks:
        findings.append(
            Finding(
                "damaged",
                path.name,
                f"{counted(damage.bad_chunks, 'chunk is', 'chunks are')} damaged; {remedy}",
                damage.bad_chunks,
            )
        )
    if damage.bad_records:
        first = f", first: {damage.first_bad}" if damage.first_bad else ""
        text = f"{damage.bad_records} definitions, messages or stretches of bytes make no sense{first}; {remedy}"
        findings.append(Finding("damaged", path.name, text, damage.bad_records))
    if damage.nameless:
        whose = counted(damage.nameless, "message belongs", "messages belong")
        text = f"{whose} to a channel whose definition is lost: the topic cannot be known"
        findings.append(Finding("damaged", path.name, text, damage.nameless))
    if damage.missing:
        text = f"the file's own count has {counted(damage.missing, 'message')} more than are in it"
        findings.append(Finding("damaged", path.name, text, damage.missing))
    if damage.before:
        text = f"was saved from a log that was not whole; how many messages are missing is not known: {damage.before}"
        findings.append(Finding("recovered", path.name, text))
    return findings


def foreign_in_words(foreign: dict[str, int]) -> list[str]:
    """One line on the skipped messages of other programs; empty if there are none."""
    if not foreign:
        return []
    names = [topic or "a topic without a name" for topic in foreign]
    named = ", ".join(names[:_MOST_TOPICS]) + (
        f" and {len(names) - _MOST_TOPICS} more" if len(names) > _MOST_TOPICS else ""
    )
    return [f"{counted(sum(foreign.values()), 'message')} of other programs passed over: {named}"]
