"""Check of a run log in one pass; the memory does not grow with the log."""

import re
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from bridge.arrays import Indices, Records
from bridge.faults import Fault
from bridge.log.check.channel import ChannelLimits, channel_findings, channels_of
from bridge.log.check.schema_check import schema_findings
from bridge.log.check.signal_range import CheckedSignal
from bridge.log.damage import damage_findings
from bridge.log.finding import Finding
from bridge.log.in_charge import ChargeWatch
from bridge.log.log_reader import LogReader
from bridge.log.logfile import STREAMING, block_period_ns, check_log_file, feed
from bridge.log.metadata import configuration_of, number_of
from bridge.log.storage.checksums import Checksums, checksum_findings
from bridge.log.topic_watch import TopicWatch
from bridge.log.watches.event_watch import EventWatch
from bridge.units import counted
from bridge.wire.channels import CHANNELS
from bridge.wire.event_codes import event_code
from bridge.wire.payloads import READABLE_VERSIONS
from bridge.wire.topics import BY_NAME
from bridge.wire.words import FAILURE, MAINTENANCE, OUTSIDE

LATE_NS = 1_000_000  # 1 ms, the usual block: a later answer arrives after the next block is due
# Share of late messages from which a rig is too slow. Smaller: any desktop fails; larger: a slow controller passes.
LATE_SHARE = 0.01
_OF_EVERY_BLOCK = {
    "plant": ("applied",),
    "controller": ("command", "trace"),
}  # topics with a message per block, by sender


class LogCheck(NamedTuple):
    """The result of the check of a log."""

    log: str
    findings: list[Finding]
    messages: dict[str, int]  # number of messages by streaming topic
    seconds: float  # duration of all sensor blocks
    late_share: dict[str, float]  # share of messages later than 1 ms: /applied (block sent), /trace (answer ready)
    checksums: Checksums
    foreign: dict[str, int]  # number of messages by topic of another program, not counted as findings


class LogWatch:
    """Collects the findings of one log, piece by piece, in file order; the memory does not grow with the log."""

    def __init__(self) -> None:
        self.topics = {name: TopicWatch(name) for name in STREAMING}
        self.signals = {name: CheckedSignal(dwells=name.endswith("_m")) for name in CHANNELS}
        self.late = {"applied": 0, "trace": 0}
        self.period_ns = 0.0
        self.samples_per_block = 1
        self.charge = ChargeWatch()
        self.events = EventWatch()
        self.unknown: dict[str, int] = {}

    @property
    def sample_s(self) -> float:
        """Time between two samples."""
        return self.period_ns / 1e9 / max(self.samples_per_block, 1)

    def add(self, topic: str, records: Records, log_time_ns: Indices) -> None:
        """Take messages of a streaming topic, [messages]."""
        if not len(records):
            return
        if topic == "sensors":
            self.period_ns = self.period_ns or block_period_ns(records)
            self.samples_per_block = records["drive_force_N"].shape[1]
            for name, signal in self.signals.items():
                signal.add(records[name].ravel())
        counted = topic in {"sensors", "applied"}
        self.topics[topic].add(records, log_time_ns, self.period_ns if counted else 0.0)
        if topic in {"applied", "command", "trace"}:
            getattr(self.charge, topic)(records)
        if topic in self.late:
            field = "late_ns" if topic == "applied" else "lateness_ns"
            self.late[topic] += int((records[field] > LATE_NS).sum())

    def add_others(self, topic: str, messages: Sequence[Any]) -> None:
        """Take messages of another topic."""
        if topic.startswith("event/"):
            self.events.add(messages)
        elif topic not in BY_NAME:
            self.unknown[topic] = self.unknown.get(topic, 0) + len(messages)

    def result(self, reader: LogReader, checksums: Checksums) -> LogCheck:
        """All findings, once the reader is at the end of the log."""
        path = reader.path
        findings = checksum_findings(checksums, path)
        findings += _of_file(path, reader, self)
        findings += schema_findings(reader)
        findings += self.charge.result().findings()
        for watch in self.topics.values():
            findings += watch.findings()
        findings += _of_configurations(reader)
        absent = reader.metadata.get("import", {}).get("missing", "")
        channels = _channels(reader)
        for name, signal in self.signals.items():
            if self.topics["sensors"].messages and name not in absent:
                findings += channel_findings(name, signal.result(), self.sample_s, channels[name])
        shares = {f"/{name}": late / max(self.topics[name].messages, 1) for name, late in self.late.items()}
        for where, share in shares.items():
            if share > LATE_SHARE:
                text = f"{100 * share:.1f} % of the messages were later than 1 ms: must be below {100 * LATE_SHARE:g} %"
                findings.append(Finding("late", where, text, self.late[where[1:]]))
        messages = {name: watch.messages for name, watch in self.topics.items()}
        seconds = messages["sensors"] * self.period_ns / 1e9
        return LogCheck(str(path), findings, messages, seconds, shares, checksums, reader.foreign)


def check_log(path: Path, progress: Callable[[float], None] | None = None) -> LogCheck:
    """Check a log. Raises Fault BAD_LOG for a file that is not a run log.

    `progress` is called with the share of the log read so far, 0 to 1.
    """
    check_log_file(path)
    reader, seen = LogReader(path), LogWatch()
    return seen.result(reader, feed(reader, seen, progress))


def _channels(reader: LogReader) -> dict[str, ChannelLimits]:
    try:
        return channels_of(configuration_of(reader.metadata, "plant", reader.path))
    except Fault:
        return channels_of(None)


def _of_configurations(reader: LogReader) -> list[Finding]:
    """A finding for each process whose configuration cannot be used. Imported logs have none."""
    findings: list[Finding] = []
    if "import" in reader.metadata:
        return findings
    for role in ("controller", "plant"):
        try:
            table = configuration_of(reader.metadata, role, reader.path)
            if role == "controller":
                number_of(table, "block_s", reader.path)
        except Fault as fault:
            text = fault.line.removeprefix(f"{reader.path}: ").partition("; ")[0]
            findings.append(Finding("configuration", reader.path.name, text))
    return findings


def _of_file(path: Path, reader: LogReader, seen: LogWatch) -> list[Finding]:
    findings = damage_findings(reader.damage, path)
    for role, table in reader.metadata.items():
        version = table.get("schema_version")
        if version is not None and version not in map(str, READABLE_VERSIONS):
            text = f"the {role} has schema version {version}: must be {READABLE_VERSIONS[0]} to {READABLE_VERSIONS[-1]}"
            findings.append(Finding("schema-version", path.name, text))
    for topic, times in seen.unknown.items():
        text = f"{counted(times, 'message')} of a topic unknown to this version"
        findings.append(Finding("unknown-topic", "/" + topic, text, times))
    if seen.topics["sensors"].messages == 0:
        findings.append(Finding("empty", path.name, "holds no sensor block"))
    else:
        findings += _of_absent_topics(reader, seen)
    events, listed = seen.events, set[tuple[str, str]]()
    for event in events.kept:
        key = event.source, event.code
        dropped = re.search(r"dropped=(\d{1,18})\b", event.text)
        # a gap is already a finding of its topic
        if event.code != "GAP" and event_code(event.code).letter in {FAILURE, OUTSIDE, MAINTENANCE}:
            if key not in listed:
                listed.add(key)
                times = events.counts[key]
                text = event.text + (f" (the first of {times})" if times > 1 else "")
                findings.append(Finding(event.code.lower().replace("_", "-"), f"/event/{event.source}", text, times))
        elif dropped and int(dropped[1]):
            text = f"the {event.source} dropped {counted(int(dropped[1]), 'message')} because it was too slow"
            findings.append(Finding("dropped", f"/event/{event.source}", text, int(dropped[1])))
    if reader.damage.closed and events.has("plant", "START") and not events.has("plant", "END"):
        findings.append(Finding("no-end", "/event/plant", "the plant started its run and never sent END"))
    return findings


def _of_absent_topics(reader: LogReader, seen: LogWatch) -> list[Finding]:
    """A finding for each empty topic that a process of the run must send for every block. Imported logs have none."""
    if "import" in reader.metadata:
        return []
    blocks = counted(seen.topics["sensors"].messages, "block")
    return [
        Finding("absent", f"/{name}", f"no message for {blocks}: the {role} sent none, or a program left the topic out")
        for role, names in _OF_EVERY_BLOCK.items()
        for name in names
        if role in reader.metadata and not seen.topics[name].messages
    ]
