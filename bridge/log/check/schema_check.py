"""Check of the schemas in a log, by which other programs read its messages."""

from google.protobuf import descriptor_pb2
from google.protobuf.message import DecodeError

from bridge.log.finding import Finding
from bridge.log.log_reader import LogReader
from bridge.wire.topics import BY_NAME, SCOPE, Topic

_ENCODING = "protobuf"


def schema_findings(reader: LogReader) -> list[Finding]:
    """A finding for each topic whose schema is missing, unreadable or of another message."""
    findings: list[Finding] = []
    for channel in reader.definitions.channels.values():
        topic = (BY_NAME | {SCOPE.name: SCOPE}).get(channel.topic.removeprefix("/"))
        if topic is None:
            continue
        schema = reader.definitions.schemas.get(channel.schema_id)
        wanted = topic.message.DESCRIPTOR.full_name
        if schema is None:
            text = f"its channel names schema {channel.schema_id}, which is missing"
        elif channel.message_encoding != _ENCODING or schema.encoding != _ENCODING:
            text = f"is {channel.message_encoding!r} with a schema in {schema.encoding!r}: both must be {_ENCODING!r}"
        elif schema.name != wanted:
            text = f"its schema is {schema.name!r}: must be {wanted!r}"
        else:
            text = _schema_fault(schema.data, topic)
        if text:
            findings.append(Finding("schema", channel.topic, f"{text}; other programs cannot read it, or misread it"))
    return findings


def _schema_fault(data: bytes, topic: Topic) -> str:
    """The fault of a serialised FileDescriptorSet, as text; empty if it describes the topic's message."""
    files = descriptor_pb2.FileDescriptorSet()
    try:
        files.ParseFromString(data)
    except DecodeError:
        return "its schema is not a FileDescriptorSet"
    name = topic.message.DESCRIPTOR.name
    messages = [message for file in files.file for message in file.message_type if message.name == name]
    if not messages:
        return f"its schema describes no {name}"
    theirs = {field.number: (field.name, field.type) for field in messages[0].field}
    ours = {field.number: (field.name, field.type) for field in topic.message.DESCRIPTOR.fields}
    # a version may append fields; the meaning of a field number never changes
    wrong = sorted(number for number in theirs.keys() & ours.keys() if theirs[number] != ours[number])
    if wrong:
        return f"its schema gives field {wrong[0]} as {theirs[wrong[0]][0]!r}: must be {ours[wrong[0]][0]!r}"
    if not theirs:
        return f"its schema describes {name} without a field"
    return ""
