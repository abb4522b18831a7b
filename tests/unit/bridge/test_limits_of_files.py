"""Files made to fill the memory or to take minutes, pipes and devices are refused at once with a one-line message."""

import os
import stat
import time
import zipfile
from pathlib import Path

import pytest
from typer.testing import CliRunner

from bench.blind.pooling import _read as opened_set
from bench.blind.sealing import read_key
from bridge.config import Strict, read_toml, validate
from bridge.faults import FAULTS, Fault
from bridge.log.check.log_check import check_log
from bridge.log.library import LIBRARY
from bridge.log.logfile import read_run
from bridge.log.mcap_chunks import ChunkWriter
from bridge.log.recover import recover
from bridge.plain import plain
from bridge.tables.sheet import read_sheet
from bridge.tables.text.dialect import Dialect
from bridge.wire.messages import COMMAND
from cockpit.cli import app
from cockpit.run.scenario_file import load_bus


def bomb(path: Path, chunks: int, messages: int) -> None:
    """Chunks of equal commands without message indexes: a small compressed file that expands to a large one."""
    with path.open("wb") as file:
        writer = ChunkWriter(file, LIBRARY)
        schema = writer.add_schema("stickslip.Command", "protobuf", b"")
        writer.add_channel("/command", "protobuf", schema, {})
        payload = COMMAND.blank().tobytes()
        for _ in range(chunks):
            writer.add_message(1, 1, payload, 1, 1)
            writer.open_chunk.parts *= messages
            writer.flush()
        writer.finish()


@pytest.mark.parametrize(
    ("chunks", "messages", "message"),
    [(1, 800_000, "holds a chunk of "), (60, 60_000, "would unpack to more than ")],
)
@pytest.mark.slow
def test_a_log_that_is_made_to_fill_the_memory_is_refused(
    tmp_path: Path, chunks: int, messages: int, message: str
) -> None:
    path = tmp_path / "bomb.mcap"
    bomb(path, chunks, messages)
    assert path.stat().st_size < 200_000
    began_s = time.process_time()
    for use in (read_run, check_log, lambda one: recover(one, tmp_path / "saved.mcap")):
        with pytest.raises(Fault, match=rf"BAD_LOG: .*bomb.mcap: .*{message}.*do not trust it"):
            use(path)
    assert time.process_time() - began_s < 4.0
    assert not (tmp_path / "saved.mcap").exists()


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("x = [" + "1," * 1_500_000 + "]", "3 MB: must be at most 2 MiB"),
        (".".join("a" * 20_000) + " = 1", "has a key of more than 32 parts"),
        (" . ".join(['"a b"'] * 20_000) + " = 1", "has a key of more than 32 parts"),
        ("[" + ".".join("a" * 5000) + "]", "has a key of more than 32 parts"),
        ("x = {" + ".".join("a" * 5000) + " = 1}", "has a key of more than 32 parts"),
        ("x = " + "[" * 20_000, "not valid TOML"),
    ],
    ids=["large", "dotted", "quoted", "header", "inline", "brackets"],
)
def test_a_toml_file_that_would_take_minutes_is_refused_at_once(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "manifest.toml"
    path.write_text(text)
    began_s = time.process_time()
    with pytest.raises(Fault, match=rf"CONFIG: .*manifest.toml: {message}"):
        read_toml(path)
    assert time.process_time() - began_s < 1.0


def test_numbers_and_texts_with_many_points_are_not_counted_as_keys(tmp_path: Path) -> None:
    path = tmp_path / "rig.toml"
    path.write_text("x = [" + ", ".join(["1.5"] * 200) + ']\ny = "' + "a." * 100 + '"\n# ' + "... " * 100 + "\n")
    assert len(read_toml(path)["x"]) == 200


def test_only_the_first_of_many_problems_are_listed() -> None:
    class Model(Strict):
        numbers: list[int]

    with pytest.raises(Fault) as caught:
        validate(Model, {"numbers": ["x"] * 1000}, "rig.toml")
    lines = caught.value.line.splitlines()
    assert (len(lines), lines[-1]) == (21, "rig.toml: and 980 more problems")


INPUTS = (
    ("run", "--scenario", "{pipe}.toml"),
    ("run", "--rig", "{pipe}.toml"),
    ("status", "--scenario", "{pipe}.toml"),
    ("log", "info", "{pipe}.mcap"),
    ("log", "check", "{pipe}.mcap"),
    ("log", "recover", "{pipe}.mcap"),
    ("log", "export", "{pipe}.mcap", "--to", "{folder}/x.csv"),
    ("log", "import", "{pipe}.csv", "--map", "{pipe}.toml", "--out", "{folder}/out"),
    ("replay", "{pipe}.mcap"),
    ("plot", "{pipe}.mcap"),
    ("map", "--rig", "{pipe}.toml", "--out", "{folder}/x.png"),
)


@pytest.mark.parametrize("words", INPUTS, ids=lambda words: " ".join(words[:3]))
@pytest.mark.timeout(120)
def test_a_pipe_as_input_is_refused(tmp_path: Path, words: tuple[str, ...]) -> None:
    for suffix in ("toml", "mcap", "csv", "json"):
        os.mkfifo(tmp_path / f"pipe.{suffix}")
    given = [word.format(pipe=tmp_path / "pipe", folder=tmp_path) for word in words]
    result = CliRunner().invoke(app, given)
    assert result.exit_code in {fault.exit_status for fault in FAULTS.values()}
    assert "must be a file on a disk" in result.output or "no file on a disk" in result.output


def test_a_pipe_as_key_or_set_is_refused(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe.json")
    for read in (read_key, opened_set):
        with pytest.raises(Fault, match=r"BAD_SET: .*pipe.json: cannot be read: must be a file on a disk"):
            read(tmp_path / "pipe.json")


def test_a_device_as_scenario_is_refused() -> None:
    with pytest.raises(Fault, match=r"CONFIG: /dev/zero.*: (no such file|must be a file on a disk)"):
        load_bus("/dev/zero/x.toml", [])


@pytest.mark.parametrize(
    ("text", "shown"),
    [
        ("\x1b]0;owned\x07\x1b[2J", r"\x1b]0;owned\x07\x1b[2J"),
        ("a\rb\x7f\x9b", r"a\rb\x7f\x9b"),
        ("a\u202eb\u2066", r"a\u202eb\u2066"),
        ("plain\ttext\nµ", "plain\ttext\nµ"),
    ],
)
def test_control_characters_are_written_out(text: str, shown: str) -> None:
    assert plain(text) == shown


def test_a_name_with_escape_codes_reaches_no_terminal(tmp_path: Path) -> None:
    name = "LOG\x1b]0;owned\x07.mcap"
    result = CliRunner().invoke(app, ["log", "info", str(tmp_path / name)])
    assert "\x1b" not in result.output
    assert r"LOG\x1b]0;owned\x07.mcap: no such file" in result.output


def test_a_folder_that_others_may_write_to_keeps_no_kernels(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    from bridge import kernel_cache

    shared = tmp_path / "shared"
    shared.mkdir()
    shared.chmod(0o777)
    monkeypatch.setenv(kernel_cache.FOLDER, str(shared))
    cache = kernel_cache.usable_folder()
    assert cache.parent == shared
    assert stat.S_IMODE(cache.stat().st_mode) == 0o700
    assert "others may write there: compiled kernels are code, so they are stored in" in capsys.readouterr().err
    assert kernel_cache.usable_folder() == cache
    assert capsys.readouterr().err == ""  # reported only once
    cache.chmod(0o777)
    other = kernel_cache.usable_folder()
    assert shared not in other.parents
    assert "others may write to it" in capsys.readouterr().err
    monkeypatch.setenv(kernel_cache.FOLDER, str(tmp_path / "new"))
    assert stat.S_IMODE(kernel_cache.usable_folder().stat().st_mode) == 0o700


@pytest.mark.parametrize("suffix", [".xlsx", ".ods"])
def test_a_workbook_that_grows_to_gigabytes_is_refused_before_it_is_read(tmp_path: Path, suffix: str) -> None:
    """0.9 MB of zeros took 1.5 GB of memory and 94 s."""
    path = tmp_path / f"bomb{suffix}"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        archive.writestr("xl/worksheets/sheet1.xml", bytes(300_000_000))
    assert path.stat().st_size < 2_000_000
    line = f"bomb{suffix}: has 300 MB after decompression: must be at most 256 MB; save the sheet with the measurement as .csv"
    with pytest.raises(Fault, match=line):
        read_sheet(path, Dialect())
