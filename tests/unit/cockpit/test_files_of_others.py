# ruff: noqa: E501  a table of files has a row for each
"""`stickslip look` and `log import` at files as other programs write them."""

import gzip
import json
import re
import shlex
import struct
import subprocess
import sys
import wave
from collections.abc import Iterable
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import pyarrow as pa
import pytest
from google.protobuf import descriptor_pb2
from mcap.writer import Writer
from pyarrow import feather
from typer.testing import CliRunner

from cockpit.cli import app
from tests.unit.cockpit.files_of_others import FORCE_N, KINDS, PLACE_MM, SLIPS, T_S, TOP_N, Kind, rows


def look(path: Path, *words: str) -> dict[str, Any]:
    """The result, or the refusal with its status, as JSON."""
    result = CliRunner().invoke(app, ["look", str(path), *words, "--json"])
    assert result.exception is None or isinstance(result.exception, SystemExit), result.exception
    return json.loads(result.stdout) | {"status": result.exit_code}


def found(seen: dict[str, Any]) -> str:
    return "\n".join(f"{row['kind']}: {row['text']}" for row in seen["findings"])


def is_right(seen: dict[str, Any], top: float = TOP_N, slips: int = SLIPS) -> None:
    assert seen["status"] == 0, seen
    assert seen["numbers"]["static_force_N"]["value"] == pytest.approx(top, rel=0.01)
    assert abs(seen["slips"] - slips) <= 1
    assert seen["numbers"]["period_s"]["value"] == pytest.approx(0.4, rel=0.01)


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.name)
@pytest.mark.slow
def test_a_file_of_another_program_opens_at_the_first_try(tmp_path: Path, kind: Kind) -> None:
    (tmp_path / kind.name).write_bytes(kind.text.encode(kind.encoding))
    seen = look(tmp_path / kind.name, *kind.options)
    is_right(seen, kind.top)
    assert seen["numbers"]["static_force_N"]["unit"] == kind.unit
    if kind.unit not in ("N", "N m"):
        assert not {"stiffness_N_per_m", "mass_kg", "mu_s"} & seen["numbers"].keys()


def test_a_joint_of_a_message_named_a_is_no_ampere(tmp_path: Path) -> None:
    with h5py.File(tmp_path / "joints.h5", "w") as file:
        for name, values in (("t", T_S), ("effort[A]", FORCE_N), ("position[C]", PLACE_MM)):
            file[f"joints/{name}"] = values
    seen = look(tmp_path / "joints.h5", "--force", "joints.effort[A]", "--time", "joints.t", "--speed", "1mm/s")
    is_right(seen)
    assert seen["numbers"]["static_force_N"]["unit"] == "N"


def mcap_of(path: Path, encoding: str, schema: bytes, messages: Iterable[bytes]) -> None:
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=20_000)
        writer.start("other", "1.0")
        channel = writer.register_channel("/rig", encoding, writer.register_schema("rig", encoding, schema))
        for t_s, data in zip(T_S.tolist(), messages, strict=True):
            writer.add_message(channel, round(t_s * 1e9) + 1, data, round(t_s * 1e9) + 1)
        writer.finish()


def test_messages_in_json_are_read_also_after_a_recorder_was_killed(tmp_path: Path) -> None:
    path = tmp_path / "rig.mcap"
    mcap_of(path, "json", b"{}", (json.dumps({"force_N": force}).encode() for force in FORCE_N.tolist()))
    is_right(look(path, "--force", "/rig.force_N", "--speed", "1mm/s"))
    data = path.read_bytes()
    path.write_bytes(data[: int(0.5 * len(data))])
    cut = look(path, "--force", "/rig.force_N")
    assert 3 <= cut["slips"] < SLIPS
    assert "its end is missing, as after a recorder that was killed" in found(cut)


def test_messages_of_ros_1_are_named_with_a_way_on(tmp_path: Path) -> None:
    mcap_of(tmp_path / "a.mcap", "ros1", b"float64 data", (struct.pack("<d", force) for force in FORCE_N))
    assert "/rig, ros1 with ros1 (2000)" in look(tmp_path / "a.mcap")["line"]


HEAD = "Run {n}\nStarted at: 10:00:{at:06.3f} 12 May 2026\n\nT,Ff\nsec,N\n\n"
HALF = len(T_S) // 2


def two_steps(path: Path, apart_s: float) -> Path:
    """A file of two recipe steps with a head each; the time begins again."""
    parts = [HEAD.format(n=n, at=n * (2.0 + apart_s)) + rows(T_S[:HALF], FORCE_N[:HALF]) + "\n" for n in (0, 1)]
    path.write_text("".join(parts))
    return path


@pytest.mark.slow
def test_steps_of_a_recipe_are_pieces_with_their_starts(tmp_path: Path) -> None:
    path = two_steps(tmp_path / "steps.csv", 50.0)
    both = look(path, "--speed", "1mm/s", "--load", "28N")
    is_right(both)
    assert [piece["start_s"] for piece in both["pieces"]] == pytest.approx([0.0, 52.0])
    assert [piece["slips"] for piece in both["pieces"]] == [5, 5]
    assert both["pieces"][0]["numbers"]["mu_mean"]["value"] == pytest.approx(11.0 / 28.0, rel=0.01)
    assert look(path, "--piece", "2", "--speed", "1mm/s")["slips"] == 5
    assert "--piece 3: must be from 1 to 2" in look(path, "--piece", "3")["line"]
    path.write_text("t [s],F [N]\n" + 2 * rows(T_S[:HALF], FORCE_N[:HALF]))
    assert "the start of 1 is not stated" in found(look(path, "--speed", "1mm/s"))


@pytest.mark.slow
def test_an_import_makes_a_run_of_each_piece(tmp_path: Path) -> None:
    path = two_steps(tmp_path / "steps.csv", 50.0)
    options = ["--speed", "1mm/s", "--force", "Ff", "--json"]
    done = json.loads(
        CliRunner().invoke(app, ["log", "import", str(path), "--out", str(tmp_path / "ev"), *options]).stdout
    )
    assert done["files"] == ["steps-1.parquet", "steps-2.parquet"]
    assert (tmp_path / "ev" / "manifest.toml").read_text().count("[[run]]") == 2
    log = tmp_path / "run.mcap"
    done = json.loads(
        CliRunner().invoke(app, ["log", "import", str(path), "--out", str(log), "--piece", "2", *options]).stdout
    )
    assert done["files"] == ["run-2.mcap"]
    assert (tmp_path / "run-2.mcap").exists()


@pytest.mark.parametrize(
    "words", [["log", "import", "--out", "made"], ["log", "import", "--out", "made.mcap"], ["diagnose"]]
)
def test_a_current_is_never_taken_for_a_force_of_evidence(
    tmp_path: Path, words: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("a.csv").write_text("time_s,motor_current_A\n" + rows(T_S, FORCE_N / 7))
    refused = CliRunner().invoke(app, [*words, "a.csv", "--speed", "1mm/s", "--json"])
    assert "holds no force but a number in A" in json.loads(refused.stdout)["line"]


def test_strokes_have_their_coefficients(tmp_path: Path) -> None:
    sign = np.where(T_S % 2 < 1, 1.0, -1.0)
    path = tmp_path / "reciprocating.csv"
    path.write_text("t [s],F [N]\n" + rows(T_S, sign * FORCE_N))
    strokes = look(path, "--load", "28N")["strokes"]
    assert [stroke["direction"] for stroke in strokes] == [1, -1, 1, -1]
    assert strokes[0]["mean_coefficient"] == pytest.approx(11.0 / 28.0, rel=0.05)


def test_a_rate_replaces_a_time_and_says_so(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t [s],F [N]\n" + rows(T_S, FORCE_N))
    seen = look(tmp_path / "a.csv", "--rate", "1kHz")
    assert seen["numbers"]["period_s"]["value"] == pytest.approx(0.2, rel=0.01)
    assert "column t [s] is not used as the time: the rate of 1000 Hz replaces it" in found(seen)


_AREA_M2 = 1.2e-3
PRESSURES = "t [s],pA [bar],pB [bar],x [mm]\n" + rows(T_S, 2.0 + FORCE_N / _AREA_M2 / 1e5, 2.0 + 0.0 * T_S, PLACE_MM)


def test_a_force_comes_from_two_pressures(tmp_path: Path) -> None:
    """By the command line, by the map that it writes, and by a map with the keys of a rig file."""
    path, saved, map_path = tmp_path / "cylinder.csv", tmp_path / "saved.toml", tmp_path / "map.toml"
    path.write_text(PRESSURES)
    seen = look(path, "--force", "1.2e-3 * (pA - pB)", "--out", str(saved))
    is_right(seen)
    assert "derived: from pA [bar], pB [bar], each in its SI unit" in found(seen)
    is_right(look(path, "--map", str(saved)))
    map_path.write_text(
        '[numbers]\narea = 1.2e-3\n[channels]\nt_s = "t [s]"\ndrive_force_N = { derive = "area * (pA - pB)" }\n'
    )
    is_right(look(path, "--map", str(map_path)))
    assert "column 1.2e-3 * (pA - pC): not in the file" in look(path, "--force", "1.2e-3 * (pA - pC)")["line"]
    map_path.write_text('[channels]\ndrive_force_N = { derive = "area * (pA -" }\n')
    assert "channels.drive_force_N: derive: character" in look(path, "--map", str(map_path))["line"]


def convert_command(line: str) -> list[str]:
    words = shlex.split(line.partition("convert it: ")[2].partition(", and give")[0])
    return [sys.executable if word == "python" else word for word in words]


@pytest.mark.parametrize("kind", ["arrow", "wav", "gz"])
@pytest.mark.slow
def test_the_command_that_converts_a_file_works(tmp_path: Path, kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """The commands whose programs the tests have; the others name packages that this project does not use."""
    path = tmp_path / f"rig.{kind}"
    if kind == "arrow":
        feather.write_feather(pa.table({"time_s": T_S, "force_N": FORCE_N}), path, compression="uncompressed")
    elif kind == "wav":
        with wave.open(str(path), "wb") as file:
            file.setnchannels(1), file.setsampwidth(2), file.setframerate(500)
            file.writeframes((1000 * FORCE_N).astype("<i2").tobytes())
    else:
        path.write_bytes(gzip.compress(("time_s,force_N\n" + rows(T_S, FORCE_N)).encode()))
    refused = look(path)
    assert "which is not read; convert it: " in refused["line"]
    words = convert_command(refused["line"])
    monkeypatch.chdir(tmp_path)
    subprocess.run(words, check=True)
    made = {"arrow": path.with_name("rig.arrow.parquet"), "wav": path.with_name("rig.wav.csv"), "gz": tmp_path / "rig"}[
        kind
    ]
    is_right(look(made, *(["--rate", "500Hz"] if kind == "wav" else [])), 14e3 if kind == "wav" else TOP_N)


@pytest.mark.parametrize(
    ("begin", "name"),
    [
        (b"MDF     4.10", "ASAM MDF"), (b"|CF,2,1,1;", "imc FAMOS"), (b"#ROSBAG V2.0\n", "ROS 1"), (b"SQLite format 3\x00", "ROS 2 bag"),
        (b"ULog\x01\x12\x35", "ULog"), (bytes.fromhex("3e03030000000000"), "svdx"), (b"\x89PNG\r\n", "PNG"), (b"\x80\x04\x95", "pickle"),
        (b"%PDF-1.7", "PDF"), (b"<!DOCTYPE html><table>", "HTML"), (b"<?xml version='1.0'?>", "XML"), (b"7z\xbc\xaf\x27\x1c", "7-Zip"),
        (b"\x00\x01\x02\x03\x04\x05\x06\x07", "binary, of an unknown kind"), (b"PK\x03\x04" + bytes(22) + b"\x05\x00\x00\x00a.csv", "archive (zip)"),
    ],
)  # fmt: skip
def test_a_file_of_a_kind_that_is_not_read_is_named(tmp_path: Path, begin: bytes, name: str) -> None:
    (tmp_path / "data").write_bytes(begin + bytes(2000))
    refused = look(tmp_path / "data")
    assert refused["status"] == 2
    assert name in refused["line"]
    assert re.search(r"convert it: |export it|unzip ", refused["line"])


def test_prose_and_spectra_are_no_records(tmp_path: Path) -> None:
    (tmp_path / "README.md").write_text("# A rig\n" + "It has 3 axes and a piezo.\n" * 50)
    assert "is a text with numbers in 0 % of its lines" in look(tmp_path / "README.md")["line"]
    hz = np.arange(5.0, 135.0, 0.5)
    (tmp_path / "psd.csv").write_text("freq,psd_x,psd_y\n" + rows(hz, 1 / hz, 2 / hz))
    assert "column 'freq' is a frequency, so this is a spectrum" in look(tmp_path / "psd.csv")["line"]


@pytest.mark.parametrize("way", ["following_error_mm", "position_mm"])
def test_stick_slip_shows_without_a_force(tmp_path: Path, way: str) -> None:
    """On a spring of 10 N/mm the slide lies F / k behind its drive; a motion without slips and a ripple show no stick-slip."""
    path = tmp_path / "axis.csv"
    lag_mm = FORCE_N / 10 - 1.1
    even_mm = 0.3 * np.sin(2 * np.pi * T_S / 0.4)
    for behind_mm, answer in ((lag_mm, "yes"), (even_mm, "no")):
        shown = behind_mm if way.startswith("foll") else 2 * T_S - behind_mm
        path.write_text(
            f"time_s,{way}\n" + rows(T_S, shown + 1e-4 * np.random.default_rng(1).standard_normal(len(T_S)))
        )
        seen = look(path)
        assert seen["stick_slip"] == answer
        assert answer != "yes" or seen["numbers"]["frequency_Hz"]["value"] == pytest.approx(2.5, rel=0.02)
    assert seen["headline"].startswith("stick-slip: no")


def test_the_page_and_the_slips_of_pieces_without_a_force(tmp_path: Path) -> None:
    path, page, slips = tmp_path / "a.csv", tmp_path / "a.html", tmp_path / "slips.csv"
    path.write_text("t [s],current_A\n" + 2 * rows(T_S[:HALF], FORCE_N[:HALF] / 7))
    assert look(path, "--out", str(page), "--out", str(slips))["status"] == 0
    assert "<h2>Pieces</h2>" in page.read_text()
    assert "breakaway_force_A" in slips.read_text().splitlines()[0]


def test_messages_of_protobuf_are_read(tmp_path: Path) -> None:
    kind = descriptor_pb2.FileDescriptorProto(name="rig.proto", package="rig", syntax="proto3")
    field = kind.message_type.add(name="Sample").field
    double, optional = (
        descriptor_pb2.FieldDescriptorProto.TYPE_DOUBLE,
        descriptor_pb2.FieldDescriptorProto.LABEL_OPTIONAL,
    )
    field.add(name="force_N", number=1, type=double, label=optional)
    schema = descriptor_pb2.FileDescriptorSet(file=[kind]).SerializeToString()
    with (tmp_path / "rig.mcap").open("wb") as file:
        writer = Writer(file)
        writer.start("other", "1.0")
        channel = writer.register_channel("/rig", "protobuf", writer.register_schema("rig.Sample", "protobuf", schema))
        for t_s, force_N in zip(T_S.tolist(), FORCE_N.tolist(), strict=True):
            at_ns = round(t_s * 1e9) + 1
            writer.add_message(channel, at_ns, b"\x09" + struct.pack("<d", force_N), at_ns)  # field 1, 8 bytes
        writer.finish()
    is_right(look(tmp_path / "rig.mcap", "--force", "/rig.force_N"))
