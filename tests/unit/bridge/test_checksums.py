"""The checksums of a log: one changed byte anywhere is found, other tools read the file, an old log has fewer checksums."""

import hashlib
import random
from pathlib import Path

import pytest
from mcap.reader import make_reader
from mcap.records import DataEnd
from mcap.stream_reader import StreamReader

from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from bridge.log.recover import recover
from bridge.log.storage.checksums import checksums_in_words, checksums_of
from bridge.log.storage.parts import parts_of
from cockpit.judge.judged import judge
from cockpit.judge.verdict_words import in_words
from tests.logs import short_log
from tests.unit.bridge.test_log_files import rotated

OLD = Path(__file__).parents[2] / "old_logs" / "schema-1.mcap"  # has a checksum of each chunk and of its index alone


def changed(folder: Path, at: int, bit: int = 0) -> Path:
    data = bytearray(short_log())
    data[at] ^= 1 << bit
    path = folder / "changed.mcap"
    path.write_bytes(data)
    return path


def test_an_unchanged_log_passes(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    sums = checksums_of(path)
    assert sums == (hashlib.sha256(short_log()).hexdigest(), [], True, "none")
    assert checksums_in_words(sums) == f"file     SHA-256 {sums.sha256}; no verdict is stored"
    assert sums.sha256 in "\n".join(in_words(judge(path), verbose=True))


def test_the_digest_of_a_log_covers_all_of_its_files(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    parts = parts_of(path)
    data = b"".join(part.read_bytes() for part in parts)
    assert checksums_of(path) == (hashlib.sha256(data).hexdigest(), [], True, "none")
    assert checksums_of(path, alone=True).sha256 == hashlib.sha256(path.read_bytes()).hexdigest()


def places() -> list[int]:
    """Every kind of record: the definitions, the configuration, chunks, indexes, the summary, the footer, the end."""
    data = short_log()
    chosen = random.Random(1)
    offsets = [*range(8, 60), *chosen.sample(range(len(data)), 40), *range(len(data) - 60, len(data))]
    return [*offsets, data.index(b'"v_ratio": ') + 11]


def test_one_changed_byte_is_found_wherever_it_is(tmp_path: Path) -> None:
    for at in places():
        assert checksums_of(changed(tmp_path, at, bit=at % 8)).damaged == ["changed.mcap"], at


def test_a_changed_configuration_is_a_finding_and_no_good_run(tmp_path: Path) -> None:
    path = tmp_path / "edited.mcap"
    path.write_bytes(short_log().replace(b'"v_ratio": 1.2', b'"v_ratio": 1.6'))
    findings = [finding for finding in check_log(path).findings if finding.kind == "changed"]
    assert [finding.where for finding in findings] == ["edited.mcap"]
    assert "it was damaged or changed after writing; do not trust it" in findings[0].text
    assert any(fault.startswith("changed: does not fit") for fault in judge(path).faults)
    recover(path, tmp_path / "recovered.mcap")
    assert "bytes of the log were changed after it was written or judged" in judge(tmp_path / "recovered.mcap").doubts


def test_a_chunk_that_was_taken_out_is_found(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    with path.open("rb") as file:
        starts = [index.chunk_start_offset for index in make_reader(file).get_summary().chunk_indexes]
    path.write_bytes(short_log()[: starts[3]] + short_log()[starts[4] :])
    assert checksums_of(path).damaged == ["run.mcap"]


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_cut_log_has_no_checksum_of_all_its_data(tmp_path: Path, share: float) -> None:
    data, path = short_log(), tmp_path / "cut.mcap"
    path.write_bytes(data[: int(share * len(data))])
    sums = checksums_of(path)
    assert (sums.damaged, sums.complete) == ([], False)
    assert "a changed byte outside of its chunks cannot be detected" in checksums_in_words(sums)
    recover(path, path)
    assert checksums_of(path).complete
    assert not [finding for finding in check_log(path).findings if finding.kind == "changed"]


def test_an_old_log_without_a_checksum_of_its_data_is_reported_and_no_finding() -> None:
    check = check_log(OLD)
    assert (check.findings, check.checksums.complete) == ([], False)
    assert "a changed byte outside of its chunks cannot be detected" in checksums_in_words(check.checksums)


def test_other_programs_read_it_and_its_checksums(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        messages = sum(1 for _ in reader.iter_messages())
        assert {metadata.name for metadata in reader.iter_metadata()} == {"run", "plant", "controller", "part"}
        assert reader.get_summary().statistics.message_count == messages
    with path.open("rb") as file:  # raises for a wrong checksum of the data
        ends = [record for record in StreamReader(file, validate_crcs=True).records if isinstance(record, DataEnd)]
    assert ends[0].data_section_crc
    assert read_run(path).headers.keys() == {"run", "plant", "controller"}


@pytest.mark.parametrize("end", [(None, b"x"), (-1, b""), (-8, b"")])
def test_another_end_of_the_file_hides_no_changed_byte(tmp_path: Path, end: tuple[int | None, bytes]) -> None:
    path = changed(tmp_path, 2000)
    path.write_bytes(path.read_bytes()[: end[0]] + end[1])
    assert "cut" in [finding.kind for finding in check_log(path).findings]


def test_recovery_keeps_the_mark_of_a_changed_log(tmp_path: Path) -> None:
    out = tmp_path / "recovered.mcap"
    assert "its bytes were changed after writing" in recover(changed(tmp_path, 2000), out).damage.before
    assert "recovered" in [finding.kind for finding in check_log(out).findings]
