"""The evidence folder: its content is read, and each error names its place."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
import scipy.io

from bridge.faults import Fault
from diagnosis.evidence.folder import load_evidence, read_columns
from diagnosis.evidence.manifest_keys import ChannelMap
from tests.evidence_folder import MANIFEST, Columns, columns, folder, kinds
from tests.logs import doctored, short_log


def test_a_good_folder(tmp_path: Path) -> None:
    data = columns()
    evidence = load_evidence(folder(tmp_path, data))
    (run,) = evidence.runs
    assert kinds(evidence) == {}
    assert [finding.where for finding in evidence.findings] == [
        "run-01.parquet: base_accel_mps2",
        "run-01.parquet: mass_position_m",
    ]
    assert evidence.rig.mass_kg == 1.5
    assert evidence.rig.tolerance["coulomb_force_N"] == 0.03
    assert run.drive_velocity_mps == 0.0005
    assert (run.t_s == data["t_s"]).all()
    for name, values in run.columns.items():
        assert values.dtype == np.float64
        assert (values == data[name]).all()


def test_a_run_states_how_its_file_is_written_its_piece_and_its_derived_force(tmp_path: Path) -> None:
    """The keys of a channel map and of `look`: [source] with a rate, `piece`, `derive` with [numbers]."""
    data = columns()
    pressure_Pa = data["drive_force_N"] / 1.2e-3
    rows = [f"{1e-5 * p:.9f};{1e3 * x:.9f}" for p, x in zip(pressure_Pa, data["drive_position_m"], strict=True)]
    path = folder(tmp_path, data)
    head = "Kräft [bar];s [mm]"
    (path / "run-01.csv").write_text("\n".join([head, *(2 * [*rows, head])][:-1]) + "\n", encoding="cp1252")
    manifest = (path / "manifest.toml").read_text().replace("run-01.parquet", "run-01.csv")
    rate_Hz = 1.0 / float(np.diff(data["t_s"]).mean())
    keys = f'piece = 2\nsource = {{ encoding = "cp1252", sample_rate_Hz = {rate_Hz!r}, delimiter = ";" }}\n'
    channels = (
        '[channels]\ndrive_force_N = { derive = "area * Kräft" }\ndrive_position_m = "s"\n[numbers]\narea = 1.2e-3\n'
    )
    manifest = manifest.replace("[[run]]\n", f"{channels}[[run]]\n{keys}")
    (path / "manifest.toml").write_text(manifest)
    (run,) = load_evidence(path).runs
    assert run.file == "run-01-2.csv"
    assert run.columns["drive_force_N"] == pytest.approx(data["drive_force_N"], abs=1e-3)
    (path / "manifest.toml").write_text(manifest.replace("piece = 2\n", ""))
    with pytest.raises(Fault, match="holds 2 runs, and must hold one; give piece = 1"):
        load_evidence(path)


@pytest.mark.parametrize(
    ("old", "new", "expected"),
    [
        ('"evidence/1"', '"evidence/2"', "manifest.toml: format = 'evidence/2': must be"),
        ('format = "evidence/1"', "", "manifest.toml: format: missing"),
        ("[[run]]", "[[runs]]", ": unknown key; perhaps run; known here: channels, format, numbers, rig, run"),
        ('"spring"', '"springs"', "manifest.toml: rig.drive = 'springs'"),
        ('"spring"', '"force"', 'rig: drive_stiffness_N_per_m: unknown with drive = "force"'),
        ("drive_stiffness_N_per_m = 11700.0", "", "rig: drive_stiffness_N_per_m: missing"),
        ("mass_kg = 1.5", "mass_kg = -1.5", "manifest.toml: rig.mass_kg = -1.5: must be greater than 0"),
        ("mass_kg = 1.5", 'mass_kg = "1.5"', "rig.mass_kg = '1.5': must be a number; write it without quotes"),
        ("mass_kg = 1.5", "mass_kg = nan", "rig.mass_kg = nan"),
        ("static_force_N = 17.38", "static_force_N = 7.38", "rig: static_force_N = 7.38: must not be below"),
        ("mass_kg = 0.005", "mass = 0.005", "rig: tolerance.mass = 0.005: unknown key; known here: mass_kg,"),
        ("mass_kg = 0.005", "mass_kg = 5.0", "tolerance.mass_kg = 5: must be from 0 to 1; it is relative"),
        ("[[run]]", '[channels]\nforce = { column = "F" }\n[[run]]', "channels.force: unknown key; known here: t_s,"),
        ("[[run]]", "[channels]\nt_s = { scale = 2.0 }\n[[run]]", "channels.t_s.column: missing"),
        (
            "[[run]]",
            "[[run]]\nspeed = 1",
            "manifest.toml: run.0.speed = 1: unknown key; known here: channels, drive_velocity_mps, file",
        ),
        (
            "[[run]]",
            '[channels]\nt_s = { colum = "t" }\n[[run]]',
            "channels.t_s.colum = 't': unknown key; perhaps column; known here: column",
        ),
        ("[[run]]", '[[run]]\nfile = "./run-01.csv"\n[[run]]', "run.file = './run-01.csv': 2 runs are called 'run-01'"),
        (
            "[[run]]",
            "[channels]\nt_s = 3.5\n[[run]]",
            "channels.t_s = 3.5: must be a table; write t_s = { column = VALUE }",
        ),
        ("mass_kg = 1.5", "mass_kg = 1e300", "rig.mass_kg = 1e+300: must be less than"),
        (
            "mass_kg = 1.5",
            "mass_kg = 1e9",
            "mass_kg = 1e+09 on drive_stiffness_N_per_m = 11700: a slip would take 918 s",
        ),
        ("mass_kg = 1.5", "mass_kg = 1e-5", "mass_kg = 1e-05: swings at 2.78e+06 rad/s: must be 90000 at most"),
        ("mass_kg = 1.5", "mass_kg = 0.009", "mass_kg = 0.009: swings at 9.28e+04 rad/s: must be 90000 at most"),
        (
            "drive_stiffness_N_per_m = 11700.0",
            "drive_stiffness_N_per_m = 1.4e9",
            "drive_stiffness_N_per_m = 1.4e+09 on mass_kg = 1.5: swings at 3.06e+04 rad/s: must be 30000 at most; check",
        ),
        ("run-01.parquet", "../run-01.parquet", "file = '../run-01.parquet': must lie in the evidence folder"),
        ("run-01.parquet", "run-01.pdf", "file = 'run-01.pdf': must end in .parquet, .csv, .txt"),
        ("run-01.parquet", "run-07.parquet", "run-07.parquet: no such file; correct run.file in manifest.toml"),
        (
            "drive_velocity_mps = 0.0005",
            "drive_velocity_mps = 1e300",
            "drive_velocity_mps = 1e+300: must be less than or equal to 10",
        ),
        ("drive_velocity_mps = 0.0005", "holdout = true", "run.holdout = true for every run"),
        ("[[run]]", "[[run", "manifest.toml: not valid TOML"),
        ("[[run]]", "[run]", "manifest.toml: run: is one table: must be a list of them; write [[run]] above each"),
    ],
)
def test_a_bad_manifest_names_the_key(tmp_path: Path, old: str, new: str, expected: str) -> None:
    assert old in MANIFEST
    with pytest.raises(Fault) as caught:
        load_evidence(folder(tmp_path, columns(), MANIFEST.replace(old, new)))
    assert caught.value.kind.code == "BAD_EVIDENCE"
    assert caught.value.kind.exit_status == 2
    assert expected in caught.value.line


def without(*names: str) -> Callable[[Columns], None]:
    def change(data: Columns) -> None:
        for name in names:
            del data[name]

    return change


def words(data: Columns) -> None:
    data["drive_force_N"] = ["overload"] * len(data["t_s"])


def starts_again(data: Columns) -> None:
    data["t_s"][2000:] -= 1.0


def half_is_nan(data: Columns) -> None:
    data["t_s"][::3] = np.nan


def half_a_second(data: Columns) -> None:
    for name in data:
        data[name] = data[name][:1000]


def time_in_ks(data: Columns) -> None:
    data["t_s"] = data["t_s"] * 1e-3


def another_speed(factor: float) -> Callable[[Columns], None]:
    def change(data: Columns) -> None:
        data["drive_position_m"] = data["drive_position_m"] * factor

    return change


def paused(data: Columns) -> None:
    data["t_s"][1000:] += 1800.0


def full_of_holes(data: Columns) -> None:
    for row in range(400, 4000, 400):
        data["t_s"][row:] += 0.05


def short(data: Columns) -> None:
    for name in data:
        data[name] = data[name][:9]


def in_micronewton(data: Columns) -> None:
    data["drive_force_N"] = data["drive_force_N"] * 1e6
    del data["mass_accel_mps2"]


@pytest.mark.parametrize(
    ("change", "expected"),
    [
        (without("t_s"), "run-01.parquet: t_s: missing; the file has drive_force_N,"),
        (
            without("drive_force_N", "mass_accel_mps2"),
            "run-01.parquet: has drive_position_m, t_s: must have drive_force_N or",
        ),
        (words, "run-01.parquet: column drive_force_N: row 1 = 'overload': must be a number"),
        (
            starts_again,
            "run-01.parquet: t_s: begins again: holds 2 runs, and must hold one",
        ),
        (half_is_nan, "run-01.parquet: t_s: 1334 samples are no finite number, first row 1"),
        (half_a_second, "run-01.parquet: t_s: 0.5 s long: must be 1 s at least; give a longer run"),
        (time_in_ks, "0.002 s long: must be 1 s at least; give a longer run; a sample every 5e-07 s"),
        (another_speed(-1.0), "drive_position_m: moves at -0.0005 m/s on average, but drive_velocity_mps = 0.0005"),
        (another_speed(4.0), "drive_position_m: moves at 0.002 m/s on average, but drive_velocity_mps = 0.0005"),
        (paused, "t_s: 1 gap in time, first at 0.4995 s, the longest 1.8e+03 s"),
        (full_of_holes, "19 % of the run in all: must be 1 s and 10 % at most; split the file there"),
        (short, "run-01.parquet: t_s: 9 rows: must have 16 at least"),
        (in_micronewton, "drive_force_N: largest value 1.70"),
    ],
)
def test_bad_data_names_the_column_and_the_row(
    tmp_path: Path, change: Callable[[Columns], None], expected: str
) -> None:
    data = columns()
    change(data)
    with pytest.raises(Fault) as caught:
        load_evidence(folder(tmp_path, data))
    assert caught.value.kind.code == "BAD_EVIDENCE"
    assert expected in caught.value.line


def test_neither_drive_position_nor_velocity(tmp_path: Path) -> None:
    data = columns()
    del data["drive_position_m"]
    with pytest.raises(Fault, match=r"run-01.parquet: drive_velocity_mps: missing"):
        load_evidence(folder(tmp_path, data, MANIFEST.replace("drive_velocity_mps = 0.0005", "")))


def test_a_force_drive_needs_its_force_and_an_answer(tmp_path: Path) -> None:
    force = "\n".join(line for line in MANIFEST.splitlines() if not line.startswith(("drive_s", "drive_d")))
    force = force.replace('"spring"', '"force"')
    data = columns()
    with pytest.raises(Fault, match="drive_force_N: missing"):
        load_evidence(folder(tmp_path, {name: data[name] for name in ("t_s", "mass_accel_mps2")}, force))
    with pytest.raises(Fault, match="must have mass_accel_mps2 or mass_position_m"):
        load_evidence(folder(tmp_path, {name: data[name] for name in ("t_s", "drive_force_N")}, force))


def test_a_channel_map_scales_a_run_log_too(tmp_path: Path) -> None:
    log = tmp_path / "run.mcap"
    log.write_bytes(short_log())
    plain, damaged = read_columns(log, {})
    assert damaged == []
    doubled = ChannelMap(column="drive_force_N", scale=2.0, offset=1.0)
    other = ChannelMap(column="a", scale=9.0)  # of the folder's other files
    scaled, _ = read_columns(log, {"drive_force_N": doubled, "mass_accel_mps2": other})
    assert (scaled["drive_force_N"] == 2.0 * plain["drive_force_N"] + 1.0).all()
    assert (scaled["mass_accel_mps2"] == plain["mass_accel_mps2"]).all()


def test_channels_are_mapped_and_scaled(tmp_path: Path) -> None:
    data = columns()
    raw = {"time": data["t_s"] * 1e3, "F": data["drive_force_N"] * 10 - 4}
    channels = '[channels]\nt_s = { column = "time", scale = 1e-3 }\n'
    channels += 'drive_force_N = { column = "F", scale = 0.1, offset = 0.4 }\n[[run]]'
    evidence = load_evidence(folder(tmp_path, raw, MANIFEST.replace("[[run]]", channels)))
    assert evidence.runs[0].t_s == pytest.approx(data["t_s"])
    assert evidence.runs[0].columns["drive_force_N"] == pytest.approx(data["drive_force_N"])
    with pytest.raises(Fault, match=r"run-01.parquet: column time: not in the file; known here: t_s, drive_force_N"):
        load_evidence(folder(tmp_path, data, MANIFEST.replace("[[run]]", channels)))


@pytest.mark.slow
def test_every_format_gives_the_same(tmp_path: Path) -> None:
    data = columns()
    manifest = MANIFEST
    for file in ("b.csv", "c.mat", "d.parquet"):
        manifest += f'[[run]]\nfile = "{file}"\n'
    folder(tmp_path, data, manifest)
    pq.write_table(pa.table(data), tmp_path / "d.parquet")
    pyarrow.csv.write_csv(pa.table(data), tmp_path / "b.csv")
    scipy.io.savemat(tmp_path / "c.mat", data)
    evidence = load_evidence(tmp_path)
    for run in evidence.runs:
        assert (run.columns["drive_force_N"] == data["drive_force_N"]).all(), run.file
    assert [run.holdout for run in evidence.runs] == [False, False, False, True]
    assert "d.parquet" in kinds(evidence)["holdout"]


def test_a_run_log_is_a_run(tmp_path: Path) -> None:
    (tmp_path / "run.mcap").write_bytes(short_log())
    columns, _ = read_columns(tmp_path / "run.mcap", {})
    assert len(columns["t_s"]) == 8000
    assert np.diff(columns["t_s"]) == pytest.approx(5e-5)
    assert {"drive_force_N", "base_accel_mps2", "vibration_frequency_Hz"} <= columns.keys()


def test_the_command_in_force_is_the_applied_command(tmp_path: Path) -> None:
    def change(tables: dict[str, Any]) -> None:
        tables["command"]["amplitude_m"] = 1e-9 * (tables["command"]["block"] + 1)

    doctored(tmp_path, change, "run.mcap")
    amplitude_m = read_columns(tmp_path / "run.mcap", {})[0]["vibration_amplitude_m"].reshape(400, 20)
    # in lockstep block n moves under the command that answers block n - 1
    assert amplitude_m[:, 0] == pytest.approx(1e-9 * np.arange(400))


@pytest.mark.parametrize("name", ["run-01.parquet", "run.csv", "run.mat", "run.mcap"])
@pytest.mark.slow
def test_a_file_whose_content_does_not_fit_its_suffix_is_refused(tmp_path: Path, name: str) -> None:
    (tmp_path / "manifest.toml").write_text(MANIFEST.replace("run-01.parquet", name))
    (tmp_path / name).write_bytes(b"\x00\x01nothing of the kind\xff" * 20)
    with pytest.raises(Fault) as caught:
        load_evidence(tmp_path)
    assert caught.value.kind.code == "BAD_EVIDENCE"
    assert name in caught.value.line


def test_a_manifest_with_a_byte_order_mark_is_read_and_another_encoding_refused(tmp_path: Path) -> None:
    folder(tmp_path, columns())
    (tmp_path / "manifest.toml").write_text(MANIFEST, encoding="utf-8-sig")
    assert load_evidence(tmp_path).rig.mass_kg == 1.5
    (tmp_path / "manifest.toml").write_text(MANIFEST, encoding="utf-16")
    with pytest.raises(Fault, match=r"manifest.toml: is not UTF-8 from byte 1 on; save it as UTF-8"):
        load_evidence(tmp_path)


def test_no_folder_and_no_manifest(tmp_path: Path) -> None:
    with pytest.raises(Fault, match="no such folder"):
        load_evidence(tmp_path / "absent")
    with pytest.raises(Fault, match=r"test_folder\.py: no folder; evidence is"):
        load_evidence(Path(__file__))
    with pytest.raises(Fault, match=r"manifest.toml: no such file"):
        load_evidence(tmp_path)


def test_a_run_or_a_manifest_that_is_a_link_out_of_the_folder_is_not_read(tmp_path: Path) -> None:
    made = folder(tmp_path, columns())
    secret = tmp_path.parent / f"{tmp_path.name}-secret.csv"
    secret.write_text("TOP-SECRET-LINE\n")
    run = next(path for path in made.iterdir() if path.name != "manifest.toml")
    kept = run.read_bytes()
    run.unlink()
    run.symlink_to(secret)
    with pytest.raises(Fault, match=r"BAD_EVIDENCE: manifest.toml: run.file = .* is a link that leads out") as caught:
        load_evidence(made)
    assert "TOP-SECRET" not in caught.value.line
    run.unlink()
    run.with_name(f"real{run.suffix}").write_bytes(kept)
    run.symlink_to(f"real{run.suffix}")  # a link within the folder is one
    assert load_evidence(made).runs
    (made / "manifest.toml").unlink()
    (made / "manifest.toml").symlink_to(secret)
    with pytest.raises(Fault, match=r"manifest.toml: is a link that leads out of the folder") as caught:
        load_evidence(made)
    assert "TOP-SECRET" not in caught.value.line
