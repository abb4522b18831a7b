"""The hash chain: one changed byte anywhere is found, a cut log is verified as far as it goes, other tools read the file."""

import random
from pathlib import Path

import pytest
from mcap.reader import make_reader

from bridge.log.check.log_check import check_log
from bridge.log.logfile import read_run
from bridge.log.recover import recover
from bridge.log.storage.chain import chain_in_words, chain_of
from cockpit.judge.judged import judge
from cockpit.judge.verdict_words import in_words
from tests.logs import short_log

OLD = Path(__file__).parents[2] / "old_logs" / "schema-1.mcap"  # written before there was a chain


def changed(folder: Path, at: int, bit: int = 0) -> Path:
    data = bytearray(short_log())
    data[at] ^= 1 << bit
    path = folder / "changed.mcap"
    path.write_bytes(data)
    return path


def test_a_log_as_it_was_written(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    chain = chain_of(path)
    assert (chain.changes, chain.ended, chain.closed) == (0, True, True)
    assert chain.links == 12  # ten chunks of blocks, one of the events, and the end
    assert chain.last in chain_in_words(chain)
    assert chain.last in "\n".join(in_words(judge(path), verbose=True))


def places() -> list[int]:
    """Every kind of record: the definitions, the configuration, chunks, indexes, links, the summary, the footer, the end."""
    data = short_log()
    chosen = random.Random(1)
    return [*range(8, 60), *chosen.sample(range(len(data)), 40), *range(len(data) - 60, len(data))]


def test_one_changed_byte_is_found_wherever_it_is(tmp_path: Path) -> None:
    data = short_log()
    for at in [*places(), data.index(b'"v_ratio": ') + 11, data.index(b"sha256") + 12]:
        chain = chain_of(changed(tmp_path, at, bit=at % 8))
        assert chain.changes or not chain.closed, at


def test_a_changed_configuration_is_a_finding_and_no_good_run(tmp_path: Path) -> None:
    data = short_log()
    path = tmp_path / "edited.mcap"
    path.write_bytes(data.replace(b'"v_ratio": 1.2', b'"v_ratio": 1.6'))
    findings = [finding for finding in check_log(path).findings if finding.kind == "changed"]
    assert len(findings) == 1
    assert "were changed after writing; do not trust them" in findings[0].text
    assert any(fault.startswith("changed: bytes ") for fault in judge(path).faults)


def test_a_chunk_that_was_taken_out_is_found(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    with path.open("rb") as file:
        starts = [index.chunk_start_offset for index in make_reader(file).get_summary().chunk_indexes]
    path.write_bytes(short_log()[: starts[3]] + short_log()[starts[4] :])
    assert chain_of(path).changes


@pytest.mark.parametrize("share", [0.3, 0.6])
def test_a_cut_log_is_verified_up_to_its_last_whole_chunk(tmp_path: Path, share: float) -> None:
    data, path = short_log(), tmp_path / "cut.mcap"
    path.write_bytes(data[: int(share * len(data))])
    chain = chain_of(path)
    assert (chain.changes, chain.ended, chain.closed) == (0, False, False)
    assert chain.links >= 1
    assert "intact up to the last whole chunk" in chain_in_words(chain)
    recover(path, path)
    assert chain_of(path).ended
    assert not [finding for finding in check_log(path).findings if finding.kind == "changed"]


def test_a_log_without_a_chain_is_told_and_no_finding() -> None:
    check = check_log(OLD)
    assert (check.findings, check.chain.links) == ([], 0)
    assert chain_in_words(check.chain).startswith("chain    none: this log was written without one")


def test_other_programs_read_it(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        messages = sum(1 for _ in reader.iter_messages())
        assert {metadata.name for metadata in reader.iter_metadata()} == {"run", "plant", "controller"}
        assert reader.get_summary().statistics.message_count == messages
    assert read_run(path).headers.keys() == {"run", "plant", "controller"}
