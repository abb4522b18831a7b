"""`stickslip look` at units that a file states or does not, and at cells without a value."""

import json
from pathlib import Path

import numpy as np
import pytest
import xlsxwriter
from typer.testing import CliRunner

from cockpit.cli import app
from tests.unit.cockpit.test_look_command import said, saw_teeth, seen_in, table_of


def test_a_unit_in_a_name_that_is_not_known_is_told_with_a_map_too(tmp_path: Path) -> None:
    t_s, force_N, _ = saw_teeth()
    path = table_of(tmp_path / "a.csv", "Time [shake],Fx [ozf]", t_s, force_N)
    given = tmp_path / "map.toml"
    given.write_text("[channels]\nt_s = 'Time'\ndrive_force_N = 'Fx'\n")
    for more in ([], ["--map", str(given)]):
        told = said(seen_in(path, *more))
        for unit, column in (("shake", "Time [shake]"), ("ozf", "Fx [ozf]")):
            assert f"units: column {column}: {unit!r} is no unit that is known here: taken as it is" in told
        assert "states no unit" not in told


@pytest.mark.parametrize(
    ("unit", "load", "told"),
    [
        ("kg", 10.0, ""),
        ("g", 1e4, ""),
        ("lbs", 22.04623, ""),
        ("daN", 9.80665, ""),
        ("furlong", 98.0665, "taken as N; add"),
    ],
)
def test_a_load_in_grams_is_a_weight(tmp_path: Path, unit: str, load: float, told: str) -> None:
    t_s, force_N, _ = saw_teeth()
    seen = seen_in(table_of(tmp_path / "a.csv", f"t [s],Ff [N],Load [{unit}]", t_s, force_N, np.full(len(t_s), load)))
    assert seen["numbers"]["mu_s"]["value"] == pytest.approx(16.0 / 98.0665, rel=2e-3)
    assert told in said(seen)


@pytest.mark.parametrize(("name", "told"), [("Speed", True), ("Speed [mm/tick]", True), ("Speed [m/s]", False)])
def test_a_speed_without_a_unit_that_is_known_is_told(tmp_path: Path, name: str, told: bool) -> None:
    t_s, force_N, _ = saw_teeth()
    seen = seen_in(table_of(tmp_path / "a.csv", f"t [s],F [N],{name}", t_s, force_N, np.full(len(t_s), 5e-4)))
    assert "stiffness_N_per_m" in seen["numbers"]
    assert ("states no unit that is known here: taken as m/s; add --speed" in said(seen)) == told


@pytest.mark.parametrize(
    ("formula", "told"),
    [("Force [N]", "column 'Force [N]' holds no number"), ("Time [s]", "1 of 100 rows have a time and a force")],
)
def test_formulas_that_nobody_calculated_are_named(tmp_path: Path, formula: str, told: str) -> None:
    """As a script writes them: without the values that a spreadsheet program saves beside."""
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
    assert told in json.loads(refused.stdout)["line"]


def test_cells_without_a_value_are_told_once(tmp_path: Path) -> None:
    """Those of a workbook with an error come as empty ones; a text in place of a number is told where it is read."""
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
    told = {(one["where"].partition(": ")[2], one["text"]) for one in findings if one["kind"] == "not-finite"}
    without = "3 rows of 1000 without a number (an empty cell, or one with an error), first row 78; left out"
    assert told == {
        ("drive_force_N", without),
        ("column Position [mm]", "2 cells without a number, first row 90 = 'lost'; left out"),
    }


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
