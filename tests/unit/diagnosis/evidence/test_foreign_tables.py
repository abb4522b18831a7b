"""Tables of other programs come in as they are, with a map that names the columns and nothing else."""

import gzip
from itertools import cycle
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from bridge.faults import Fault
from bridge.tables.kinds import kind_of
from bridge.tables.unit_words import known_unit, unit_in_name
from diagnosis.evidence.folder import read_columns
from diagnosis.evidence.import_table import import_file
from tests.unit.diagnosis.evidence.foreign_tables import FORCE, KINDS, POSITION, Kind, T, write

RIG = """
[rig]
drive = "spring"
mass_kg = 1.5
drive_stiffness_N_per_m = 11700.0
coulomb_force_N = 8.0
static_force_N = 14.0
stribeck_velocity_mps = 0.0005
[run]
drive_velocity_mps = 0.001
"""


def channel_map(folder: Path, **columns: str) -> Path:
    lines = ["[channels]", *(f"{name} = '{column}'" for name, column in columns.items() if column)]
    path = folder / "map.toml"
    path.write_text("\n".join(lines) + RIG, encoding="utf-8")
    return path


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.file)
@pytest.mark.slow
def test_a_foreign_table_comes_in(tmp_path: Path, kind: Kind) -> None:
    source = write(kind, tmp_path)
    time, force, position = kind.columns
    given = channel_map(tmp_path, t_s=time, drive_force_N=force, drive_position_m=position)
    if kind.force_too != 1.0:
        given.write_text(
            given.read_text().replace(f"'{force}'", f"{{ column = '{force}', scale = {1 / kind.force_too} }}")
        )
    done = import_file(source, given, tmp_path / "evidence")
    table = pq.read_table(tmp_path / "evidence" / done.file)
    t_s = table["t_s"].to_numpy()
    assert t_s - t_s[0] == pytest.approx(T[kind.rows] - T[kind.rows][0], abs=2e-6)
    got = table["drive_force_N"].to_numpy()
    finite = np.isfinite(got)
    assert (~finite).sum() <= 1
    assert got[finite] == pytest.approx(FORCE[kind.rows][finite], abs=2e-5)
    if position:
        late = 0.05 if kind.file == "start-offset.tdms" else 0.0
        assert table["drive_position_m"].to_numpy() == pytest.approx(POSITION[kind.rows] - 1e-3 * late, abs=2e-8)
    assert kind.says in " ".join(finding.text for finding in done.findings)


@pytest.mark.parametrize("separator", [",", "\t"])
@pytest.mark.parametrize("with_units", [False, True])
@pytest.mark.parametrize(
    "ends",
    [("\n",), ("\r",), ("\r\n",), ("\r\r\n",), ("\n\r",), ("\n\n",), ("\n", "\r\n", "\r"), ("\r",) * 3 + ("\n",) * 300],
)
def test_lines_may_end_in_any_way(tmp_path: Path, ends: tuple[str, ...], with_units: bool, separator: str) -> None:
    cells = [
        ["t_s", "drive_force_N"],
        *([["s", "N"]] if with_units else []),
        *([f"{t:.6f}", f"{f:.5f}"] for t, f in zip(T, FORCE, strict=True)),
    ]
    lines = [separator.join(row) for row in cells]
    text = "".join(line + end for line, end in zip(lines, cycle(ends), strict=False))
    (tmp_path / "a.csv").write_bytes(text.encode())
    columns, findings = read_columns(tmp_path / "a.csv", {})
    assert columns["t_s"] == pytest.approx(T, abs=1e-6)
    assert columns["drive_force_N"] == pytest.approx(FORCE, abs=1e-5)
    assert {finding.kind for finding in findings} <= {"assumed"}


def test_a_unit_of_another_quantity_is_refused(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t [s],Temp [°C],M [Nm]\n" + "".join(f"{t},20.5,{2 + t}\n" for t in T))
    with pytest.raises(Fault, match=r"column Temp: is in °C, a temperature: must be a force, as drive_force_N"):
        import_file(tmp_path / "a.csv", channel_map(tmp_path, t_s="t", drive_force_N="Temp"), tmp_path / "out")
    with pytest.raises(Fault, match=r'is in Nm, a torque, and the rig slides; a rotary rig has drive = "torsion"'):
        import_file(tmp_path / "a.csv", channel_map(tmp_path, t_s="t", drive_force_N="M"), tmp_path / "out")


def test_without_a_time_one_line_asks_for_it(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("F\n" + "".join(f"{f}\n" for f in FORCE))
    with pytest.raises(
        Fault, match=r"a.csv: no time: .*add under \[source\] sample_rate_Hz = 1000.0 \(columns here: F\)"
    ):
        import_file(tmp_path / "a.csv", channel_map(tmp_path, drive_force_N="F"), tmp_path / "out")


@pytest.mark.parametrize("name", ["x.npz", "x.npy", "x.csv"])
def test_arrays_of_numpy_are_named_with_the_way_to_columns(tmp_path: Path, name: str) -> None:
    with (tmp_path / name).open("wb") as file:
        np.save(file, T) if name == "x.npy" else np.savez(file, t=T, force=T)
    with pytest.raises(Fault) as caught:
        kind_of(tmp_path / name)
    assert f"{name}: holds NumPy arrays, without names for time and force" in str(caught.value)
    assert 'write them as columns of a text: numpy.savetxt("NAME.csv"' in str(caught.value)


def test_a_packed_file_is_named_as_one(tmp_path: Path) -> None:
    (tmp_path / "a.csv.gz").write_bytes(gzip.compress(b"t,F\n0,1\n"))
    with pytest.raises(Fault, match=r"a.csv.gz: is packed by gzip, which is not read; convert it: gunzip --keep "):
        import_file(tmp_path / "a.csv.gz", channel_map(tmp_path, t_s="t", drive_force_N="F"), tmp_path / "out")


@pytest.mark.parametrize(
    ("name", "unit"),
    [
        *(("Kraft/kN", "kN"), ("Weg/µm", "µm"), ("t/s", "s"), ("s/mm", "mm"), ("v/mm/s", "mm/s"), ("Zeit/min", "min")),
        *((name, "") for name in ("U/min", "kN/s", "N/mm", "counts/s", "log/t", "/imu/g", "plant/axis/s", "Kraft/Weg")),
    ],
)  # fmt: skip
def test_a_unit_after_a_slash_is_distinguished_from_paths_and_rates(name: str, unit: str) -> None:
    assert unit_in_name(name) == unit


@pytest.mark.parametrize(
    ("unit", "known"),
    [
        ("daN", ("force", 10.0)),
        ("KN", ("force", 1e3)),
        ("MM", ("length", 1e-3)),
        ("N·mm", ("torque", 1e-3)),
        ("Ncm", ("torque", 1e-2)),
    ],
)
def test_units_of_machine_builders_are_known(unit: str, known: tuple[str, float]) -> None:
    assert known_unit(unit) == known
