"""CSV files of other countries, encodings and kinds."""

import os
import signal
import threading
from pathlib import Path

import pytest

from bridge.faults import Fault
from bridge.tables.readers import Dialect, read_table
from diagnosis.evidence.folder import load_evidence
from diagnosis.evidence.import_table import import_file
from tests.patience import PATIENCE_S
from tests.unit.diagnosis.evidence.measured_tables import CSV, GERMAN, MAP, SOURCE, raw, setup, write_raw


@pytest.mark.parametrize(
    ("text", "channel_map", "expected"),
    [
        (CSV.replace("9,56", "OVL", 1), SOURCE + GERMAN, "row 7 = 'OVL'; left out"),
        (CSV, GERMAN, "delimiter = ';', decimal = ','"),
        (CSV.replace("F", "F/µm", 1), SOURCE + GERMAN.replace('"F"', '"F/µm"'), "encoding = 'cp1252'"),
        (
            CSV.replace("1,0;9,52", "1,0", 1),
            SOURCE + GERMAN,
            "1 line with another number of cells left out, first '1,0'",
        ),
        (f"{CSV}End of test\n", SOURCE + GERMAN, "1 line with another number of cells left out, first 'End of test'"),
        (f"My rig\n{CSV}", SOURCE + GERMAN, "skip_rows = 1"),
        (CSV + "2000,0;ü\n", SOURCE + GERMAN, "row 4001 = 'ü'; left out"),
    ],
    ids=["text", "delimiter", "encoding", "ragged", "footer", "names further down", "a cell"],
)
def test_an_unusual_csv_file_is_read_with_a_finding(tmp_path: Path, text: str, channel_map: str, expected: str):
    (tmp_path / "a.csv").write_text(text, encoding="latin-1")
    (tmp_path / "map.toml").write_text(channel_map)
    done = import_file(tmp_path / "a.csv", tmp_path / "map.toml", tmp_path / "out.mcap")
    assert any(expected in finding.text for finding in done.findings)
    assert done.rows >= 3980


def test_a_map_that_contradicts_its_file_is_refused_with_the_place(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(CSV.replace("F", "F/µm", 1), encoding="latin-1")
    with pytest.raises(Fault, match=r"a.csv: line 1: is not utf-8: .*leave source.encoding out"):
        read_table(tmp_path / "a.csv", Dialect(";", ",", encoding="utf-8"))
    with pytest.raises(Fault, match=r"source.encoding = 'utf-9': unknown to Python"):
        read_table(tmp_path / "a.csv", Dialect(";", ",", encoding="utf-9"))
    (tmp_path / "words.csv").write_text("a;b\n" + "x;y\n" * 40)
    with pytest.raises(Fault, match=r"words.csv: is a text with numbers in 0 % of its lines: no row of numbers"):
        read_table(tmp_path / "words.csv")


def test_a_name_with_a_control_character_stays_readable(tmp_path: Path) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    import_file(source.rename(tmp_path / "odd\x7f.csv"), channel_map, tmp_path / "evidence")
    assert load_evidence(tmp_path / "evidence").runs[0].file == "odd\x7f.parquet"


@pytest.mark.parametrize("rate_Hz", ["1e-9", "1e300"])
def test_a_sample_rate_that_no_recorder_has_is_refused(tmp_path: Path, rate_Hz: str) -> None:
    source, channel_map = setup(tmp_path, ".csv")
    channel_map.write_text(f"[source]\nsample_rate_Hz = {rate_Hz}\n" + MAP)
    with pytest.raises(Fault, match=r"CONFIG: .*source.sample_rate_Hz = .*must be"):
        import_file(source, channel_map, tmp_path / "made.mcap")


def test_a_csv_file_in_another_encoding(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text(CSV.replace("F", "F/µN", 1), encoding="latin-1")
    source = SOURCE + 'encoding = "latin-1"\n'
    (tmp_path / "map.toml").write_text(source + GERMAN.replace('column = "F"', 'column = "F/µN"'), encoding="utf-8")
    assert import_file(tmp_path / "a.csv", tmp_path / "map.toml", tmp_path / "out").rows == 4000


@pytest.mark.parametrize("start", ["\ufeff", "\ufeffLog of the rig\n"])
@pytest.mark.parametrize("encoding", ["utf-16-le", "utf-16-be"])
def test_a_csv_file_with_a_utf_16_byte_order_mark_is_read(tmp_path: Path, start: str, encoding: str) -> None:
    (tmp_path / "a.csv").write_bytes((start + CSV).encode(encoding))
    table = read_table(tmp_path / "a.csv", Dialect(";", ",", start.count("\n")))
    assert list(table.columns) == ["Zeit", "F"]
    assert table.column("F")[:2].tolist() == [9.5, 9.51]


def test_a_csv_file_in_utf_16_without_a_byte_order_mark_is_read(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_bytes(CSV.encode("utf-16-le"))
    assert len(read_table(tmp_path / "a.csv").column("F")) == 4000
    assert len(read_table(tmp_path / "a.csv", Dialect(";", ",", encoding="utf-16-le")).column("F")) == 4000


@pytest.mark.slow
def test_no_signal_is_lost_while_a_csv_file_is_read(tmp_path):
    write_raw(tmp_path / "run.csv", raw())
    got, sent = threading.Event(), 0
    before = signal.signal(signal.SIGTERM, lambda *_: got.set())
    try:
        for _ in range(100):
            got.clear()
            sender = threading.Timer(0.001, os.kill, (os.getpid(), signal.SIGTERM))
            sender.start()
            while sender.is_alive():
                read_table(tmp_path / "run.csv")
            sender.join()
            assert got.wait(PATIENCE_S), f"signal {sent} was lost"
            sent += 1
    finally:
        signal.signal(signal.SIGTERM, before)
