"""`stickslip look` at units that a file states or does not, and at cells without a value."""

import json
from pathlib import Path

import numpy as np
import pytest
import xlsxwriter
from typer.testing import CliRunner

from cockpit.cli import app
from tests.unit.cockpit.test_look_command import findings_of, saw_teeth, seen_in, table_of


def test_a_force_in_an_unknown_unit_keeps_it_and_a_map_reports_it(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    path = table_of(tmp_path / "a.csv", "Time [shake],Fx [pond]", t_s, force_N)
    given = tmp_path / "map.toml"
    given.write_text("[channels]\nt_s = 'Time'\ndrive_force_N = 'Fx'\n")
    message = findings_of(seen_in(path, "--map", str(given)))
    for unit, column in (("shake", "Time [shake]"), ("pond", "Fx [pond]")):
        assert f"units: column {column}: {unit!r} is not a known unit: the values are used unscaled" in message
    assert "states no unit" not in message
    refused = CliRunner().invoke(app, ["look", str(path), "--json"])
    assert "'shake' is not a known unit of time; add --rate 1kHz" in json.loads(refused.stdout)["line"]
    seen = seen_in(path, "--rate", "500Hz", "--speed", "0.5mm/s", "--load", "9N")
    assert seen["numbers"]["static_force_N"]["unit"] == "pond"
    assert not {"stiffness_N_per_m", "mass_kg", "mu_s"} & seen["numbers"].keys()


@pytest.mark.parametrize(
    ("unit", "load", "message"),
    [
        ("kg", 10.0, ""),
        ("g", 1e4, ""),
        ("lbs", 22.04623, ""),
        ("daN", 9.80665, ""),
        ("furlong", 98.0665, "taken as N; add"),
    ],
)
@pytest.mark.slow
def test_a_load_in_grams_is_a_weight(tmp_path: Path, unit: str, load: float, message: str) -> None:
    t_s, force_N, _ = saw_teeth()
    seen = seen_in(table_of(tmp_path / "a.csv", f"t [s],Ff [N],Load [{unit}]", t_s, force_N, np.full(len(t_s), load)))
    assert seen["numbers"]["mu_s"]["value"] == pytest.approx(16.0 / 98.0665, rel=2e-3)
    assert message in findings_of(seen)


@pytest.mark.parametrize(("name", "message"), [("Speed", True), ("Speed [mm/tick]", True), ("Speed [m/s]", False)])
def test_a_speed_without_a_known_unit_is_reported(tmp_path: Path, name: str, message: bool) -> None:
    t_s, force_N, _ = saw_teeth()
    seen = seen_in(table_of(tmp_path / "a.csv", f"t [s],F [N],{name}", t_s, force_N, np.full(len(t_s), 5e-4)))
    assert "stiffness_N_per_m" in seen["numbers"]
    assert ("states no known unit: taken as m/s; add --speed" in findings_of(seen)) == message


@pytest.mark.parametrize(
    ("formula", "message"),
    [("Force [N]", "column 'Force [N]' holds no number"), ("Time [s]", "1 of 100 rows have a time and a force")],
)
def test_formulas_without_a_saved_value_are_named(tmp_path: Path, formula: str, message: str) -> None:
    """A script writes formulas without the values that a spreadsheet program saves with them."""
    path = tmp_path / "book.xlsx"
    names = ["Time [s]", "Raw [V]", "Force [N]"]
    with xlsxwriter.Workbook(path) as book:
        sheet = book.add_worksheet()
        sheet.write_row(0, 0, names)
        for row in range(1, 101):
            for column, name in enumerate(names):
                if name == formula and row > (name == "Time [s]"):
                    sheet.write_formula(row, column, "=B1", value="")
                else:
                    sheet.write_number(row, column, row * 1e-3)
    refused = CliRunner().invoke(app, ["look", str(path), "--json"])
    assert message in json.loads(refused.stdout)["line"]


def test_cells_without_a_value_are_reported_once(tmp_path: Path) -> None:
    """Cells of a workbook with an error read as empty; a text in place of a number is reported with its row."""
    path = tmp_path / "book.xlsx"
    with xlsxwriter.Workbook(path) as book:
        sheet = book.add_worksheet()
        sheet.write_row(0, 0, ["Time [s]", "Force [N]", "Position [mm]", "Normal load [N]"])
        for row in range(1, 1001):
            sheet.write_row(row, 0, [row * 1e-3, 8.0 + row % 100 / 50.0, row * 1e-3])
            if row in (78, 500, 700):
                sheet.write_formula(row, 1, "=1/0", None, "#DIV/0!")
            if row in (90, 91):
                sheet.write_string(row, 2, "lost")
            sheet.write_formula(row, 3, "=B2", value="")
    findings = json.loads(CliRunner().invoke(app, ["look", str(path), "--json"]).stdout)["findings"]
    assert "no load, as column 'Normal load [N]' holds no number" in findings[0]["text"]
    texts = {
        (finding["where"].partition(": ")[2], finding["text"])
        for finding in findings
        if finding["kind"] == "not-finite"
    }
    without = "3 rows of 1000 without a number (an empty cell, or one with an error), first row 78; left out"
    assert texts == {
        ("column Force [N]", without),
        ("column Position [mm]", "2 cells without a number, first row 90 = 'lost'; left out"),
    }


@pytest.mark.parametrize("cell", ["", "#VALUE!"])
def test_a_load_does_not_replace_a_force_without_numbers(tmp_path: Path, cell: str) -> None:
    rows = "".join(f"{1e-3 * row:.3f};{cell};{94.5 + 0.01 * (row % 7):.2f}\n" for row in range(1000))
    (tmp_path / "a.csv").write_text(f"Time [s];Friction force [N];Fz\n{rows}")
    refused = CliRunner().invoke(app, ["look", str(tmp_path / "a.csv"), "--json"])
    assert "column 'Friction force [N]' holds no number: must hold the force" in json.loads(refused.stdout)["line"]


def test_a_normal_force_without_numbers_hides_no_force(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    rows = "".join(f"{t:.6g};;{f:.6g}\n" for t, f in zip(t_s, force_N, strict=True))
    (tmp_path / "a.csv").write_text(f"Time [s];Normal force [N];Load [N]\n{rows}")
    seen = seen_in(tmp_path / "a.csv")
    assert "force = 'Load [N]', as no other column is one" in findings_of(seen)


def test_a_column_that_ends_sooner_is_reported_with_its_row(tmp_path: Path) -> None:
    t_s, force_N, drive_mm = saw_teeth()
    rows_with_force = len(t_s) - 1000
    rows = [f"{t:.6g},{f:.6g},{x:.6g}" for t, f, x in zip(t_s, force_N, drive_mm, strict=True)]
    rows[rows_with_force:] = [row.rpartition(",")[0] + "," for row in rows[rows_with_force:]]
    (tmp_path / "a.csv").write_text("\n".join(["t [s],F [N],Position [mm]", *rows]))
    message = findings_of(seen_in(tmp_path / "a.csv"))
    assert (
        f"1000 rows of {len(t_s)} without a number (an empty cell, or one with an error), first row {rows_with_force + 1}"
        in message
    )
    assert "clock" not in message


def test_loads_that_are_missing_or_all_0_are_reported(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    partial = table_of(
        tmp_path / "a.csv", "t [s],F [N],Normal load [N]", t_s, force_N, np.where(t_s < 0.1, np.nan, 94.5)
    )
    assert "50 rows of 4000 without a number" in findings_of(seen_in(partial))
    tenth = table_of(
        tmp_path / "c.csv", "t [s],F [N],Normal load [N]", t_s, force_N, np.where(np.arange(4000) % 10, np.nan, 94.5)
    )
    assert "without a number" not in findings_of(seen_in(tenth))
    none = table_of(tmp_path / "b.csv", "t [s],F [N],Normal load [N]", t_s, force_N, np.zeros(len(t_s)))
    assert "'Normal load [N]' is 0 throughout: no load; add --load 94.5N" in findings_of(seen_in(none))


def test_a_force_that_was_tared_about_zero_is_seen_with_its_offset(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    path = table_of(tmp_path / "a.csv", "t [s],F [N]", t_s, force_N - 14.5)
    assert seen_in(path, "--out", str(tmp_path / "map.toml"))["headline"].endswith("by an offset in a map")
    written = (tmp_path / "map.toml").read_text()
    (tmp_path / "map.toml").write_text(written.replace('column = "F [N]",', 'column = "F [N]", offset = 14.5,'))
    seen = seen_in(path, "--map", str(tmp_path / "map.toml"))
    assert seen["numbers"]["static_force_N"]["value"] == pytest.approx(16.0, abs=0.1)


def test_a_time_that_cannot_be_read_is_shown(tmp_path: Path) -> None:
    rows = "".join(f"{1 + row // 500:02d}-Foo-2024 10:00:00;{row % 50}\n" for row in range(1000))
    (tmp_path / "a.csv").write_text(f"Time;F [N]\n{rows}")
    refused = CliRunner().invoke(app, ["look", str(tmp_path / "a.csv"), "--json"])
    assert (
        "column 'Time' begins with '01-Foo-2024 10:00:00', which is not read as" in json.loads(refused.stdout)["line"]
    )


def test_where_no_column_is_the_force_the_sheet_is_named(tmp_path: Path) -> None:
    path = tmp_path / "book.xlsx"
    with xlsxwriter.Workbook(path) as book:
        for name, column, rows in (("Run", "Force [N]", 50), ("Climate", "Temp [°C]", 100)):
            sheet = book.add_worksheet(name)
            sheet.write_row(0, 0, ["Time [s]", column])
            for row in range(1, rows):
                sheet.write_row(row, 0, [row, 20.0 + row % 3])
    refused = CliRunner().invoke(app, ["look", str(path), "--json"])
    assert "columns here (sheet 'Climate'; a map reads another one): " in json.loads(refused.stdout)["line"]
