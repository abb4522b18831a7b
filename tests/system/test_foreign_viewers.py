"""Logs in other programs, as far as they run here: Foxglove's schemas, the protobuf decoder, rerun's converter."""

import subprocess
import sys
from pathlib import Path

import pytest

from bridge.log.viewers import foxglove_log
from cockpit.run.run import run_scenario
from tests.unit.bridge.test_other_writers import written_anew

LAYOUTS = Path(__file__).parents[2] / "deploy" / "layouts"
RERUN = Path(sys.executable).with_name("rerun")


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    pytest.importorskip("rerun", reason="make nightly installs the viewers")
    path = tmp_path_factory.mktemp("viewers") / "run.mcap"
    run_scenario("from-the-start", ["duration_s=1"], lockstep=True, in_process=True, log=path)
    return path


def rerun(*words: object) -> str:
    done = subprocess.run([RERUN, *map(str, words)], check=True, capture_output=True, text=True, timeout=120)
    return done.stdout


@pytest.mark.nightly
def test_rerun_finds_nothing_wrong(log: Path, tmp_path: Path) -> None:
    for path in (log, written_anew(tmp_path / "anew.mcap")):
        rows = [line.split() for line in rerun("mcap", "check", path).splitlines() if "/" in line and line[0] != "/"]
        assert len(rows) >= 9
        assert {row[0] for row in rows} == {"ok"}


@pytest.mark.nightly
def test_rerun_converts_events_to_its_text_log_and_the_script_to_curves(log: Path, tmp_path: Path) -> None:
    rerun("mcap", "convert", log, "-o", tmp_path / "converted.rrd")
    converted = rerun("rrd", "print", tmp_path / "converted.rrd")
    assert any("/log " in line and "TextLog:text" in line for line in converted.splitlines())
    script = [sys.executable, LAYOUTS / "view_in_rerun.py", log, "--save", tmp_path / "script.rrd"]
    subprocess.run(script, check=True, timeout=120)
    made = rerun("rrd", "print", tmp_path / "script.rrd").splitlines()
    assert any("with 200 rows" in line and "/scope/drive_force_max_N" in line and "Scalars" in line for line in made)
    assert any("/words/mode" in line and "TextLog" in line for line in made)
    assert any("TimeSeriesView" in line or "/viewport" in line for line in made)


@pytest.mark.nightly
def test_the_protobuf_decoder_reads_every_message_by_name(log: Path) -> None:
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    with log.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        decoded = [(channel.topic, message) for _, channel, _, message in reader.iter_decoded_messages()]
        statistics = reader.get_summary().statistics
    assert len(decoded) == statistics.message_count
    last = dict(decoded)["/scope"]
    assert "mode: EXCITE" in str(last)
    assert last.drive_force_min_N <= last.drive_force_mean_N <= last.drive_force_max_N


@pytest.mark.nightly
def test_our_definition_of_the_log_message_matches_foxglove() -> None:
    messages = pytest.importorskip("foxglove.messages", reason="make nightly installs the viewers")
    from google.protobuf import descriptor_pb2

    theirs = messages.Log.get_schema()
    assert (theirs.name, theirs.encoding) == (foxglove_log.SCHEMA, "protobuf")
    of_theirs = descriptor_pb2.FileDescriptorSet.FromString(theirs.data).file[-1].message_type[0]
    of_ours = foxglove_log.FILES.file[-1].message_type[0]
    assert [(entry.name, entry.number, entry.type, entry.type_name) for entry in of_ours.field] == [
        (entry.name, entry.number, entry.type, entry.type_name) for entry in of_theirs.field
    ]
    values = [[(entry.name, entry.number) for entry in kind.enum_type[0].value] for kind in (of_ours, of_theirs)]
    assert values[0] == values[1]
