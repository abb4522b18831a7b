"""A log rewritten by another program, in every form that MCAP allows, reads the same; other programs read ours."""

import struct
from collections.abc import Callable
from io import BytesIO
from itertools import product
from pathlib import Path

import pytest
import zstandard
from mcap.reader import NonSeekingReader, make_reader
from mcap.records import Metadata
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType, IndexType, Writer

from bridge.faults import Fault
from bridge.log.check.log_check import check_log
from bridge.log.library import LIBRARY
from bridge.log.logfile import STREAMING, RunData, read_run
from bridge.log.recover import recover
from bridge.log.storage.checksums import checksums_of
from cockpit.judge.judged import judge
from cockpit.run.replay import changes_of
from controller.replay import replay
from tests.logs import short_log
from tests.unit.bridge.test_log_files import rotated

SMALL = 1 << 14  # bytes of a chunk: some forty of them
INDEXES = {"all": IndexType.ALL, "chunks alone": IndexType.CHUNK, "none": IndexType.NONE}


def written_anew(
    path: Path,
    library: str = "mcap-cli/0.1.0",
    extra: Callable[[Writer], None] = lambda _: None,
    first_id: int = 0,
    keep: Callable[[str], bool] = lambda _: True,
    each: int = 1,
    **options: object,
) -> Path:
    """The short log as the standard writer writes it; definitions lie in the chunks, where there are any.

    Messages of a topic go to `each` channels of it in turn.
    """
    source = short_log()
    with path.open("wb") as file:
        writer = Writer(file, **{"chunk_size": SMALL} | options)
        writer.start(profile="", library=library)
        for number in range(first_id):  # so that every number is another than in our own files
            writer.register_channel(f"/other/{number}", "json", writer.register_schema(f"Other{number}", "", b""))
        for record in StreamReader(BytesIO(source)).records:
            if isinstance(record, Metadata):
                writer.add_metadata(record.name, dict(record.metadata))
        schemas: dict[int, int] = {}
        channels: dict[tuple[int, int], int] = {}
        for schema, channel, message in make_reader(BytesIO(source)).iter_messages(log_time_order=False):
            if not keep(channel.topic):
                continue
            if schema.id not in schemas:
                schemas[schema.id] = writer.register_schema(schema.name, schema.encoding, schema.data)
            one = channel.id, message.sequence % each
            if one not in channels:
                about = dict(channel.metadata) | ({"publisher": str(one[1])} if each > 1 else {})
                places = channel.topic, channel.message_encoding, schemas[schema.id], about
                channels[one] = writer.register_channel(*places)
            times = message.log_time, message.data, message.publish_time, message.sequence
            writer.add_message(channels[one], *times)
        extra(writer)
        writer.finish()
    return path


def same(run: RunData, path: Path) -> bool:
    path.write_bytes(short_log())
    before = read_run(path)
    tables = all(getattr(run, name).tobytes() == getattr(before, name).tobytes() for name in STREAMING)
    return tables and run.events == before.events and run.headers == before.headers


FORMS = [
    *product(CompressionType, [True], INDEXES, [True, False]),
    *product([CompressionType.NONE], [False], ["all", "none"], [True, False]),
]


@pytest.mark.parametrize(("compression", "chunks", "index", "crcs"), FORMS)
@pytest.mark.slow
def test_every_form_is_read_and_recovered_unchanged(
    tmp_path: Path, compression: CompressionType, chunks: bool, index: str, crcs: bool
) -> None:
    summary = index != "none"
    path = written_anew(
        tmp_path / "anew.mcap",
        compression=compression,
        use_chunking=chunks,
        index_types=INDEXES[index],
        enable_crcs=crcs,
        enable_data_crcs=crcs,
        use_statistics=summary,
        repeat_channels=summary,
        repeat_schemas=summary,
        use_summary_offsets=summary,
        first_id=20,
    )
    run = read_run(path)
    assert run.damage.whole
    assert same(run, tmp_path / "source.mcap")
    recovered = recover(path, tmp_path / "recovered.mcap")
    assert recovered.damage.whole
    again = read_run(tmp_path / "recovered.mcap")
    assert same(again, tmp_path / "source.mcap")
    with path.open("rb") as one, (tmp_path / "recovered.mcap").open("rb") as other:
        theirs = [
            [(channel.topic, message.data) for _, channel, message in NonSeekingReader(file).iter_messages()]
            for file in (one, other)
        ]
    assert theirs[0] == theirs[1]
    assert recovered.messages == len(theirs[0])


@pytest.mark.parametrize("chunks", [True, False])
@pytest.mark.slow
def test_channels_of_one_topic_that_alternate_are_one_topic(tmp_path: Path, chunks: bool) -> None:
    path = written_anew(tmp_path / "anew.mcap", use_chunking=chunks, each=2)
    run = read_run(path)
    assert same(run, tmp_path / "source.mcap")
    assert (judge(path).lost_blocks, judge(path).lost_messages) == (0, 0)
    assert check_log(path).findings == []
    recover(path, tmp_path / "recovered.mcap")
    assert same(read_run(tmp_path / "recovered.mcap"), tmp_path / "source.mcap")


@pytest.mark.parametrize("library", [LIBRARY, "mcap-cli/0.1.0", ""])
def test_a_log_rewritten_by_another_library_passes_all_checks(tmp_path: Path, library: str) -> None:
    path = written_anew(tmp_path / "anew.mcap", library)
    check = check_log(path)
    assert check.findings == []
    assert (check.checksums.damaged, check.checksums.verdict) == ([], "none")
    run = read_run(path)
    assert replay(run, changes_of(run, [])).difference is None
    assert not [fault for fault in judge(path).faults if "changed" in fault]


def test_topics_of_other_programs_are_counted_and_reported_once(tmp_path: Path) -> None:
    def more(writer: Writer) -> None:
        schema = writer.register_schema("sensor_msgs/msg/Image", "ros2msg", b"uint8[] data")
        camera = writer.register_channel("/camera", "cdr", schema)
        # the name of a topic of ours, and a message of another kind
        state = writer.register_channel("/state", "json", writer.register_schema("Robot", "jsonschema", b"{}"))
        for number in range(5):
            writer.add_message(camera, number, b"\0" * 5000, number)
            writer.add_message(state, number, b"{}", number)
        writer.add_attachment(0, 0, "photo.png", "image/png", bytes(100))

    path = written_anew(tmp_path / "anew.mcap", extra=more)
    run = read_run(path)
    assert run.damage.whole
    assert same(run, tmp_path / "source.mcap")
    assert run.foreign == {"/camera": 5, "/state": 5}
    lines = [line for line in judge(path).told if "of other programs" in line]
    assert lines == ["10 messages of other programs skipped: /camera, /state"]
    assert check_log(path).foreign == run.foreign
    recovered = recover(path, tmp_path / "recovered.mcap")
    with (tmp_path / "recovered.mcap").open("rb") as file:
        counts = make_reader(file).get_summary().statistics.channel_message_counts
    assert recovered.messages == sum(counts.values())
    assert read_run(tmp_path / "recovered.mcap").foreign == run.foreign


@pytest.mark.parametrize("compression", CompressionType)
@pytest.mark.parametrize("chunks", [True, False])
@pytest.mark.parametrize("share", [0.35, 0.6])
@pytest.mark.slow
def test_a_cut_one_is_read_up_to_the_cut(
    tmp_path: Path, compression: CompressionType, chunks: bool, share: float
) -> None:
    path = written_anew(tmp_path / "anew.mcap", compression=compression, use_chunking=chunks)
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    run = read_run(path)
    assert 0 < len(run.sensors) < 400
    assert not run.damage.closed
    assert run.sensors["sequence"].tolist() == list(range(len(run.sensors)))
    recover(path, tmp_path / "recovered.mcap")
    assert read_run(tmp_path / "recovered.mcap").sensors.tobytes() == run.sensors.tobytes()


@pytest.mark.parametrize("compression", CompressionType)
def test_after_a_hole_the_next_chunk_is_read(tmp_path: Path, compression: CompressionType) -> None:
    path = written_anew(tmp_path / "anew.mcap", compression=compression)
    data = bytearray(path.read_bytes())
    summary = make_reader(BytesIO(data)).get_summary()
    assert summary is not None
    chunk = summary.chunk_indexes[len(summary.chunk_indexes) // 2]
    middle = chunk.chunk_start_offset + chunk.chunk_length // 2
    data[middle : middle + 100] = b"\xff" * 100
    path.write_bytes(data)
    run = read_run(path)
    assert 300 < len(run.sensors) < 400
    assert not run.damage.whole
    assert run.damage.missing > 0


def test_a_frame_without_its_size_is_read(tmp_path: Path) -> None:
    """As of a streaming compressor, which begins to write before it knows how much comes."""
    data = written_anew(
        tmp_path / "anew.mcap", compression=CompressionType.NONE, index_types=IndexType.NONE
    ).read_bytes()
    out, at = bytearray(data[:8]), 8
    while at < len(data) - 8:
        opcode, length = struct.unpack_from("<BQ", data, at)
        content = data[at + 9 : at + 9 + length]
        if opcode == 6:
            packed = zstandard.ZstdCompressor(write_content_size=False).compress(content[40:])
            content = content[:28] + struct.pack("<I", 4) + b"zstd" + struct.pack("<Q", len(packed)) + packed
        if opcode == 15:  # the end of the data; the footer that follows names no summary
            out += data[at : at + 9 + length] + struct.pack("<BQQQI", 2, 20, 0, 0, 0) + data[-8:]
            break
        out += struct.pack("<BQ", opcode, len(content)) + content
        at += 9 + length
    (tmp_path / "stream.mcap").write_bytes(out)
    run = read_run(tmp_path / "stream.mcap")
    assert run.damage.whole
    assert same(run, tmp_path / "source.mcap")


def test_a_topic_whose_definition_is_lost_is_reported_and_never_guessed(tmp_path: Path) -> None:
    data = short_log()
    name = data.index(b"/sensors")
    path = tmp_path / "nameless.mcap"
    # the record of the channel gets an opcode of private use; the summary, which repeats the record, is removed
    at = name - 4 - 2 - 2 - 9
    cut = data.index(b"/sensors", name + 8) - 5000
    path.write_bytes(data[:at] + b"\x90" + data[at + 1 : cut])
    run = read_run(path)
    assert len(run.sensors) == 0
    assert run.damage.nameless >= 360
    assert len(run.applied) >= 360
    recovered = recover(path, tmp_path / "recovered.mcap")
    assert recovered.damage.nameless == run.damage.nameless
    with (tmp_path / "recovered.mcap").open("rb") as file:
        topics = {channel.topic for channel in make_reader(file).get_summary().channels.values()}
    assert "/sensors" not in topics
    assert {"/applied", "/trace", "/command"} <= topics


def test_a_definition_that_is_lost_at_the_front_is_taken_from_the_summary(tmp_path: Path) -> None:
    data = bytearray(short_log())
    data[data.index(b"/sensors") - 4 - 2 - 2 - 9] = 0x90
    path = tmp_path / "summary.mcap"
    path.write_bytes(data)
    assert len(read_run(path).sensors) == 400
    assert checksums_of(path).damaged


def test_the_cause_of_missing_metadata_is_reported_correctly(tmp_path: Path) -> None:
    path = written_anew(tmp_path / "anew.mcap", keep=lambda topic: topic != "/trace")
    data = path.read_bytes().replace(b"controller", b"controllex")  # as a tool that leaves the tables out
    path.write_bytes(data)
    with pytest.raises(Fault, match="or a tool removed it later"):
        read_run(path).configuration("controller")


def test_the_files_of_a_log_may_number_their_channels_differently(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    other = tmp_path / "run-0001.mcap"
    source = other.read_bytes()
    with other.open("wb") as file:
        writer = Writer(file)
        writer.start(profile="", library="mcap-cli/0.1.0")
        writer.register_channel("/other", "json", 0)
        for record in StreamReader(BytesIO(source)).records:
            if isinstance(record, Metadata):
                writer.add_metadata(record.name, dict(record.metadata))
        for schema, channel, message in make_reader(BytesIO(source)).iter_messages():
            number = writer.register_schema(schema.name, schema.encoding, schema.data)
            place = writer.register_channel(channel.topic, channel.message_encoding, number)
            writer.add_message(place, message.log_time, message.data, message.publish_time, message.sequence)
        writer.finish()
    assert read_run(path).sensors["sequence"].tolist() == list(range(400))
    assert [finding.kind for finding in check_log(path).findings if finding.kind in {"changed", "damaged"}] == []


def test_a_topic_that_a_filter_left_out_is_named(tmp_path: Path) -> None:
    path = written_anew(tmp_path / "filtered.mcap", keep=lambda topic: topic not in {"/trace", "/applied"})
    absent = {finding.where: finding.text for finding in check_log(path).findings if finding.kind == "absent"}
    assert absent.keys() == {"/trace", "/applied"}
    assert "the controller sent none, or a program left the topic out" in absent["/trace"]
