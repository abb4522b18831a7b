"""`stickslip look`: one file, one answer, and its output files."""

import json
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from python_calamine import load_workbook
from typer.testing import CliRunner

from cockpit.cli import app


def tribometer(folder: Path) -> Path:
    """As a tribometer writes it: title lines, semicolons, decimal commas, latin-1; 5 slips of 3 N in 8 s at 0.5 mm/s."""
    t_s = np.arange(0, 8, 2e-3)
    phase = t_s % 1.5
    fall = 13.0 + 1.5 * (1 + np.cos(np.pi * (phase - 1.46) / 0.04))
    force_N = np.where(phase < 1.46, 13.0 + 3.0 * phase / 1.46, fall)
    rows = "".join(f"{t:.3f};{f:.4f};{94.5:.1f}\n" for t, f in zip(t_s, force_N, strict=True)).replace(".", ",")
    path = folder / "Prüfung.csv"
    path.write_bytes(("Prüfung 7\nStahl\nZeit [s];Reibkraft [N];Normalkraft [N]\n" + rows).encode("latin-1"))
    return path


@pytest.mark.slow
def test_a_file_at_a_glance(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "0")
    source = tribometer(tmp_path)
    outs = [tmp_path / f"out{suffix}" for suffix in (".html", ".csv", ".xlsx", ".svg", ".toml")]
    arguments = ["look", str(source), "--speed", "0.5mm/s", "--mass", "700kg", "--json"]
    for _ in range(2):  # a second call replaces the output of the first
        result = CliRunner().invoke(app, [*arguments, *(word for out in outs for word in ("--out", str(out)))])
        assert result.exit_code == 0, result.output
    table = json.loads(result.stdout)
    assert table["slips"] == 5
    assert table["numbers"]["static_force_N"]["value"] == pytest.approx(16.0, rel=2e-3)
    assert table["numbers"]["mu_k"]["value"] == pytest.approx(14.5 / 94.5, rel=2e-3)
    assert table["numbers"]["stiffness_N_per_m"]["value"] == pytest.approx(3.0 / 1.46 / 5e-4, rel=2e-3)
    texts = " ".join(finding["text"] for finding in table["findings"])
    assert "delimiter = ';', decimal = ',', encoding = 'cp1252', skip_rows = 2" in texts
    assert "700 is" in texts
    page = outs[0].read_text(encoding="utf-8")
    assert page.count("<svg") == 3
    assert "SHA-256" in page
    assert "1970-01-01 00:00:00 UTC" in page
    assert table["headline"].split(",")[0] in page
    assert len(outs[1].read_text().splitlines()) == 6
    assert load_workbook(str(outs[2])).get_sheet_by_name("slips").to_python()[0][0] == "breakaway_t_s"
    assert outs[3].read_text().startswith("<?xml")
    again = CliRunner().invoke(app, ["look", str(source), "--map", str(outs[4]), "--load", "94.5N", "--json"])
    assert json.loads(again.stdout)["numbers"]["mu_k"] == table["numbers"]["mu_k"]


@pytest.mark.parametrize(
    ("words", "expected"),
    [
        (["--speed", "0.5"], "--speed 0.5: has no unit, such as m/s; write for example --speed 0.5mm/s"),
        (["--load", "3kg"], "--load 3kg: must be a force above 0; write for example --load 94.5N"),
        (["--out", "a.doc"], "--out a.doc: must end in .html"),
    ],
)
def test_missing_information_is_asked_for(tmp_path: Path, words: list[str], expected: str) -> None:
    result = CliRunner().invoke(app, ["look", str(tribometer(tmp_path)), *words, "--json"])
    assert result.exit_code == 2
    assert expected in json.loads(result.stdout)["line"]


def test_a_file_of_unnamed_columns_is_asked_about(tmp_path: Path) -> None:
    (tmp_path / "a.csv").write_text("t [s],p,q\n" + "".join(f"{i},{i % 7},{i % 5}\n" for i in range(100)))
    result = CliRunner().invoke(app, ["look", str(tmp_path / "a.csv"), "--json"])
    assert (
        'which column is the force? add --force "NAME"; columns here: "t [s]", "p", "q"'
        in json.loads(result.stdout)["line"]
    )
    result = CliRunner().invoke(app, ["look", str(tmp_path / "a.csv"), "--force", "p", "--json"])
    assert result.exit_code == 0


def test_a_column_of_clock_times_is_the_time_whatever_its_name(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    rows = (f"10:00:{second:09.6f},{force:.4f}\n" for second, force in zip(t_s, force_N, strict=True))
    (tmp_path / "a.csv").write_text("When,F [N]\n" + "".join(rows))
    table = seen_in(tmp_path / "a.csv")
    assert table["slips"] == 5
    assert "time = 'When', which holds times" in findings_of(table)


def test_an_import_without_a_map_writes_the_one_it_assumed(tmp_path: Path) -> None:
    source, out = tribometer(tmp_path), tmp_path / "evidence"
    result = CliRunner().invoke(app, ["log", "import", str(source), "--out", str(out)])
    assert result.exit_code == 2
    result = CliRunner().invoke(app, ["log", "import", str(source), "--out", str(out), "--speed", "0.5mm/s"])
    assert result.exit_code == 0, result.output
    assert sorted(path.name for path in out.iterdir()) == ["Prüfung.map.toml", "Prüfung.parquet", "manifest.toml"]
    assert "mass_kg = " in (out / "Prüfung.map.toml").read_text(encoding="utf-8")


@pytest.mark.parametrize("name", ["evidence", "run.mcap", ""])
@pytest.mark.slow
def test_a_map_that_was_corrected_stays(tmp_path: Path, name: str) -> None:
    source, out = tribometer(tmp_path), tmp_path / name
    kept = {"evidence": out / "Prüfung.map.toml", "run.mcap": tmp_path / "run.map.toml"}.get(
        name, tmp_path / "map.toml"
    )
    words = ["log", "import", str(source), "--out", str(out)] if name else ["look", str(source), "--out", str(kept)]
    for _ in range(2):  # a second call replaces the output of the first
        assert CliRunner().invoke(app, [*words, "--speed", "0.5mm/s"]).exit_code == 0
        for path in tmp_path.rglob("*"):
            if path.is_file() and path not in (source, kept):
                path.unlink()
    corrected = kept.read_text(encoding="utf-8") + "# corrected\n"
    kept.write_text(corrected, encoding="utf-8")
    refused = CliRunner().invoke(app, [*words, "--speed", "0.5mm/s"])
    assert refused.exit_code == 2
    assert (
        f"{kept.name} exists with another content, which would be lost; give it to --map, or remove it"
        in refused.output
    )
    assert kept.read_text(encoding="utf-8") == corrected
    assert {path for path in tmp_path.rglob("*") if path.is_file()} == {source, kept}


def seen_in(path: Path, *words: str) -> dict[str, Any]:
    result = CliRunner().invoke(app, ["look", str(path), *words, "--json"])
    assert result.exit_code == 0, result.output
    return json.loads(result.stdout)


def findings_of(table: dict[str, Any]) -> str:
    return "\n".join(f"{finding['kind']}: {finding['text']}" for finding in table["findings"])


def saw_teeth(seconds: float = 8.0) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, force in N, and drive position in mm at 0.5 mm/s: slips of 3 N, one in 1.5 s, at 500 Hz."""
    t_s = np.arange(0, seconds, 2e-3)
    phase = t_s % 1.5
    fall = 13.0 + 1.5 * (1 + np.cos(np.pi * (phase - 1.46) / 0.04))
    return t_s, np.where(phase < 1.46, 13.0 + 3.0 * phase / 1.46, fall), 0.5 * t_s


def table_of(path: Path, head: str, *columns: np.ndarray) -> Path:
    rows = (",".join(f"{cell:.6g}" for cell in row) for row in zip(*columns, strict=True))
    path.write_text("\n".join([head, *rows]) + "\n")
    return path


def test_a_position_that_rests_during_the_sticks_belongs_to_the_slide(tmp_path: Path) -> None:
    t_s, force_N, drive_mm = saw_teeth()
    stiffness_N_per_mm = 3.0 / 1.46 / 0.5
    slide_mm = drive_mm - force_N / stiffness_N_per_mm + 5e-4 * np.random.default_rng(5).standard_normal(len(t_s))
    path = table_of(tmp_path / "a.csv", "Time (s),Force (N),Displacement (mm)", t_s, force_N, slide_mm)
    table = seen_in(path)
    assert "'Displacement (mm)' is constant during the sticks: it belongs to the slide" in findings_of(table)
    assert not {"stiffness_N_per_m", "mass_kg"} & table["numbers"].keys()
    table = seen_in(path, "--speed", "0.5mm/s", "--out", str(tmp_path / "a.toml"))
    assert table["numbers"]["stiffness_N_per_m"]["value"] == pytest.approx(1e3 * stiffness_N_per_mm, rel=2e-3)
    assert "drive_position_m" not in (tmp_path / "a.toml").read_text()
    path = table_of(tmp_path / "b.csv", "Time (s),Force (N),Displacement (mm)", t_s, force_N, drive_mm)
    assert seen_in(path)["numbers"]["stiffness_N_per_m"]["value"] == pytest.approx(1e3 * stiffness_N_per_mm, rel=2e-3)


@pytest.mark.parametrize("force_first", [True, False])
@pytest.mark.parametrize("heads", [("Time (ms),{}", "Time (ms),{}"), ("t1 (ms),{}", "t2 (ms),{}")])
@pytest.mark.slow
def test_channels_with_separate_times_are_merged_by_time(
    tmp_path: Path, force_first: bool, heads: tuple[str, str]
) -> None:
    t_s, force_N, _ = saw_teeth()
    other_s = np.arange(0, 8, 5e-3)
    pairs = [("Force (N)", t_s, force_N), ("Drive position (mm)", other_s, 0.5 * other_s)]
    pairs = pairs if force_first else pairs[::-1]
    lines = [",".join(head.format(name) for head, (name, _, _) in zip(heads, pairs, strict=True))]
    for row in range(len(t_s)):
        cells = (f"{1e3 * at[row]:.6g},{values[row]:.6g}" if row < len(at) else "," for _, at, values in pairs)
        lines.append(",".join(cells))
    path, made = tmp_path / "a.csv", tmp_path / "a.toml"
    path.write_text("\n".join(lines) + "\n")
    table = seen_in(path, "--out", str(made))
    assert table["slips"] == 5
    assert table["numbers"]["stiffness_N_per_m"]["value"] == pytest.approx(1e3 * 3.0 / 1.46 / 0.5, rel=2e-3)
    assert "is the time of 'Force (N)'" in findings_of(table)
    assert seen_in(path, "--map", str(made))["numbers"] == table["numbers"]


def test_a_counter_of_operating_time_is_not_taken_as_the_clock(tmp_path: Path) -> None:
    t_s, force_N, drive_mm = saw_teeth()
    path = tmp_path / "a.csv"
    table_of(path, "t (s),Force (N),t_on (s),Position (mm)", t_s, force_N, 0.1 * t_s, drive_mm)
    table = seen_in(path)
    assert (table["slips"], "is the time of" in findings_of(table)) == (5, False)


def test_a_second_column_of_the_same_time_is_ignored(tmp_path: Path) -> None:
    t_s, force_N, drive_mm = saw_teeth()
    path = tmp_path / "a.csv"
    table_of(path, "t (s),Force (N),Time (s),Position (mm)", t_s, force_N, t_s + 1.7e9, drive_mm)
    table = seen_in(path)
    assert (table["slips"], "is the time of" in findings_of(table)) == (5, False)


def test_a_coefficient_is_a_force_only_with_a_load(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    load_N = np.full(len(t_s), 50.0)
    table = seen_in(table_of(tmp_path / "a.csv", "Time (s),COF,Load (N)", t_s, force_N / 50.0, load_N))
    assert table["numbers"]["static_force_N"]["value"] == pytest.approx(16.0, rel=2e-3)
    assert table["numbers"]["mu_s"]["value"] == pytest.approx(0.32, rel=2e-3)
    path = table_of(tmp_path / "b.csv", "Time (s),COF", t_s, force_N / 50.0)
    numbers = seen_in(path, "--speed", "0.5mm/s")["numbers"]
    assert numbers["mu_s"]["value"] == pytest.approx(0.32, rel=2e-3)
    assert {number["unit"] for number in numbers.values()} == {"1", "s", "1/s", "rad/s"}
    assert seen_in(path, "--load", "100N")["numbers"]["static_force_N"]["value"] == pytest.approx(32.0, rel=2e-3)


def test_one_unknown_unit_leaves_the_others_known(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    path = table_of(tmp_path / "a.csv", "Timestamp,Fx,Tx\nms,kN,furlong", 1e3 * t_s, 1e-3 * force_N, t_s)
    table = seen_in(path)
    assert table["seconds"] == pytest.approx(8.0, rel=1e-3)
    assert table["numbers"]["static_force_N"]["value"] == pytest.approx(16.0, rel=2e-3)
    assert "unknown unit: 'furlong' of column Tx; kept as written" in findings_of(table)


def test_a_group_that_begins_with_0_has_a_decimal_comma(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    rows = [f"{t:.3f};{1e3 * f:,.0f}" for t, f in zip(t_s, force_N, strict=True)]
    text = "\n".join(row.translate(str.maketrans(".,", ",.")) for row in rows)
    (tmp_path / "a.csv").write_text("Zeit (s);Kraft (mN)\n" + text)
    table = seen_in(tmp_path / "a.csv")
    assert table["seconds"] == pytest.approx(8.0, rel=1e-3)
    assert table["numbers"]["static_force_N"]["value"] == pytest.approx(16.0, rel=2e-3)


def test_slow_logging_widens_the_interval_of_the_static_force(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth(60.0)
    path = table_of(tmp_path / "a.csv", "Time (s),Force (N)", t_s[::37], force_N[::37])
    low, high = seen_in(path)["numbers"]["static_force_N"]["interval_90"]
    assert low < 16.0 < high


@pytest.mark.slow
def test_outliers_are_left_out_and_reported(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    for value in (1e308, -9999.0, 999.0, -1e6):
        bad = force_N.copy()
        bad[[500, 1700, 2600]] = value
        table = seen_in(table_of(tmp_path / "a.csv", "Time (s),Force (N)", t_s, bad))
        assert table["numbers"]["kinetic_force_N"]["value"] == pytest.approx(14.5, rel=2e-3)
        assert "outlier: 3 outliers, first row 501 = " in findings_of(table)


def test_rows_that_go_back_and_gaps_are_reported(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    order = np.concatenate([np.arange(1000), np.arange(900, 2000), np.arange(2500, 4000)])
    table = seen_in(table_of(tmp_path / "a.csv", "Time (s),Force (N)", t_s[order], force_N[order]))
    assert "100 rows not later than the rows before (1 of the same time), first row 1001; left out" in findings_of(
        table
    )
    assert "time-gap: 1 gap in time, first at 3.998 s, the longest 1 s" in findings_of(table)
    path = table_of(tmp_path / "b.csv", "Time (s),Force (N)", np.tile(t_s, 2), np.tile(force_N, 2))
    twice = seen_in(path)
    assert "pieces: begins again in row 4001: 2 pieces" in findings_of(twice)
    assert [piece["slips"] for piece in twice["pieces"]] == [table["slips"] + 1] * 2


def test_a_torque_is_reported_as_a_torque(tmp_path: Path) -> None:
    text = tribometer(tmp_path).read_text(encoding="latin-1").replace("Reibkraft [N]", "Torque [N m]")
    turned = tmp_path / "turned.csv"
    turned.write_text(text.replace(";94,5", "").replace(";Normalkraft [N]", ""), encoding="latin-1")
    result = CliRunner().invoke(app, ["look", str(turned), "--json"])
    texts = " ".join(finding["text"] for finding in json.loads(result.stdout)["findings"])
    assert "'Torque [N m]' is a torque: the rig turns" in texts


def after_a_rest(folder: Path, zero: float, names: str, *more: Any) -> Path:
    """Stick-slip of a drive that begins after 2 s, on a sensor with a zero offset."""
    t_s = np.arange(0, 12, 2e-3)
    way = np.maximum(t_s - 2.0, 0.0)
    force_N = zero + np.where(way > 0.0, 10.0 + 4.0 * (way % 1.0), 0.0)
    return table_of(
        folder / "rest.csv", names, t_s, force_N + 0.01 * np.sin(997.0 * t_s), *[factor * way for factor in more]
    )


@pytest.mark.parametrize(
    ("zero", "message"), [(1.5, "is taken as the sensor's zero"), (9.0, "too large for a sensor's zero")]
)
def test_a_rest_at_the_beginning_is_the_zero_of_the_sensor(tmp_path: Path, zero: float, message: str) -> None:
    seen = seen_in(after_a_rest(tmp_path, zero, "Time (s),Force (N)"), "--out", str(tmp_path / "map.toml"))
    assert message in findings_of(seen)
    taken = zero if zero < 2.0 else 0.0
    assert seen["numbers"]["static_force_N"]["value"] == pytest.approx(14.0 + zero - taken, abs=0.1)
    written = (tmp_path / "map.toml").read_text()
    assert (re.search(r"offset = -1\.(49|50)", written) is not None) == (taken > 0.0)


def test_a_rig_that_turns_has_its_own_units(tmp_path: Path) -> None:
    seen = seen_in(after_a_rest(tmp_path, 0.0, "Time (s),Torque (N m),Angle (rad)", 0.01))
    units = {name: number["unit"] for name, number in seen["numbers"].items()}
    assert (units["static_force_N"], units["stiffness_N_per_m"], units["slope_N_per_s"]) == ("N m", "N m/rad", "N m/s")
    assert seen["numbers"]["stiffness_N_per_m"]["value"] == pytest.approx(400.0, rel=0.02)
    path = after_a_rest(tmp_path, 0.0, "Time (s),Torque (N m)")
    refused = CliRunner().invoke(app, ["look", str(path), "--speed", "0.5mm/s", "--json"])
    assert "is a torque: must be a speed such as 10mrad/s or 5rpm" in json.loads(refused.stdout)["line"]


LVM = (
    "LabVIEW Measurement\t\nSeparator\tTab\n***End_of_Header***\t\nY_Unit_Label\tkN\t\nDelta_X\t0.002\t\n"
    "***End_of_Header***\t\t\n"
)


@pytest.mark.parametrize(
    ("file", "head", "row", "message"),
    [
        (
            "bluehill.csv",
            'Rate,"30 mm/min"\n\nTime,Load\n(s),(kN)\n',
            "{t:.4f},{kN:.8f}\n",
            "as no other column is one",
        ),
        ("klipper.csv", "#time,force_g\n", "{t:.4f},{g:.4f}\n", "is in g: times 0.00980665 to be in N"),
        ("labels.lvm", LVM + "X_Value\tFriction\tComment\n", "\t{kN:.8f}\t\n", "line 4 holds units: kN"),
        ("asked.csv", "t [s],F_soll [N],F_ist [N]\n", "{t:.4f},{ms:.0f},{N:.6f}\n", "force = 'F_ist [N]' by its name"),
        ("datenum.csv", "time,F\n", "{day:.10f},{N:.6f}\n", "is a calendar time in steps of 86400 s"),
        ("french.csv", "Durée [ms];Effort [N]\n", "{ms:.0f};{N:.6f}\n", "rises evenly and has a unit of time"),
        ("traction.tsv", "Test Time (s)\tTraction Coeff (-)\n", "{t:.4f}\t{N:.6f}\n", "is a coefficient"),
    ],
)
@pytest.mark.slow
def test_column_names_of_machines_are_understood(tmp_path: Path, file: str, head: str, row: str, message: str) -> None:
    t_s, force_N, _ = saw_teeth()
    rows = (
        row.format(t=t, N=f, kN=1e-3 * f, g=f / 9.80665e-3, ms=1e3 * t, day=739316.5 + t / 86400)
        for t, f in zip(t_s, force_N, strict=True)
    )
    (tmp_path / file).write_text(head + "".join(rows))
    seen = seen_in(tmp_path / file)
    static = seen["numbers"].get("static_force_N") or seen["numbers"]["mu_s"]
    assert static["value"] == pytest.approx(16.0, abs=0.1)
    assert seen["rate_Hz"] == pytest.approx(500.0, rel=1e-3)
    assert message in findings_of(seen)
    assert file != "datenum.csv" or "taken as s" not in findings_of(seen)


def test_an_evenly_growing_position_is_not_taken_as_time_next_to_row_numbers(tmp_path: Path) -> None:
    _, force_N, drive_mm = saw_teeth()
    path = tmp_path / "halsampler.txt"
    path.write_text("".join(f"{i} {f:.5f} {x:.6f} \n" for i, (f, x) in enumerate(zip(force_N, drive_mm, strict=True))))
    refused = CliRunner().invoke(app, ["look", str(path), "--force", "2", "--json"])
    assert (
        'no time: which column is the time, or how many rows per second are there? Add --time "NAME" or --rate 1kHz'
        in json.loads(refused.stdout)["line"]
    )
    assert seen_in(path, "--force", "2", "--rate", "500Hz")["numbers"]["static_force_N"]["value"] == pytest.approx(
        16.0, abs=0.1
    )


@pytest.mark.parametrize("name", ["joint.0.motor-pos-fb", "Extension", "Crosshead"])
def test_a_position_without_a_unit_is_not_taken_as_time(tmp_path: Path, name: str) -> None:
    _, force_N, drive_mm = saw_teeth()
    path = tmp_path / "halscope.txt"
    path.write_text(f"{name};force\n" + "".join(f"{x:.6f};{f:.5f}\n" for f, x in zip(force_N, drive_mm, strict=True)))
    refused = CliRunner().invoke(app, ["look", str(path), "--json"])
    assert "no time: which column is the time" in json.loads(refused.stdout)["line"]
