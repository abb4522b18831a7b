"""A table in a log that is closed: the chain goes on, the index has it, and what cannot take one stays as it is."""

import json
from pathlib import Path

import pytest
from mcap.reader import make_reader

from bridge.log.check.log_check import check_log
from bridge.log.live import locked
from bridge.log.logfile import read_run
from bridge.log.storage.afterwards import add_table
from bridge.log.storage.parts import chain_of_log, parts_of
from cockpit.run.run import run_scenario
from tests.logs import short_log
from tests.unit.bridge.test_log_files import rotated


def test_the_table_is_read_by_anybody_and_the_chain_goes_on(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    before = chain_of_log(path)
    told = add_table(path, "verdict", {"good": True, "headline": "so it is"}, before)
    assert told == chain_of_log(path)
    assert (told.links, told.ended, told.changes) == (before.links + 1, True, 0)
    assert read_run(path).headers["verdict"] == {"good": "true", "headline": '"so it is"'}
    assert check_log(path).findings == []
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True)
        assert {table.name for table in reader.iter_metadata()} >= {"verdict", "plant", "controller"}
        assert sum(1 for _ in reader.iter_messages()) == reader.get_summary().statistics.message_count
    again = add_table(path, "second", {}, told)
    assert again == chain_of_log(path)
    data = path.read_bytes()
    path.write_bytes(data.replace(b"so it is", b"so it As"))
    assert chain_of_log(path).changes == 1


def test_of_several_files_the_last_one_has_it(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    rotated(path)
    told = add_table(path, "verdict", {"good": False}, chain_of_log(path))
    assert told == chain_of_log(path)
    assert b"verdict" in parts_of(path)[-1].read_bytes()
    assert read_run(path).headers["verdict"] == {"good": "false"}


@pytest.mark.parametrize("cut", [20, 9000])
def test_a_log_that_is_cut_stays_as_it_is(tmp_path: Path, cut: int) -> None:
    path = tmp_path / "cut.mcap"
    path.write_bytes(short_log()[:-cut])
    add_table(path, "verdict", {}, chain_of_log(path))
    assert path.read_bytes() == short_log()[:-cut]


def test_a_log_that_another_process_holds_stays_as_it_is(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(short_log())
    with path.open("r+b") as file:
        assert locked(file)
        add_table(path, "verdict", {}, chain_of_log(path))
    assert path.read_bytes() == short_log()


def test_a_run_notes_its_verdict(tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    came = run_scenario("from-the-start", ["duration_s=0.3"], lockstep=True, in_process=True, log=path)
    table = read_run(path).headers["verdict"]
    assert json.loads(table["good"]) is came.verdict.good
    assert json.loads(table["figures"])["blocks"] == 300
    assert came.verdict.chain == chain_of_log(path)
