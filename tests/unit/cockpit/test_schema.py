"""`stickslip schema`: files, results and shipped configurations agree with the schemas."""

import json
import math
import tomllib
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import jsonschema
import pytest
from typer.testing import CliRunner

from bridge.results import in_json, strict_json
from cockpit.cli import app
from cockpit.commands import diagnose_output
from cockpit.commands.as_json.schemas import FORMATS, JSON, TOML, schema_of
from cockpit.run.scenario_file import deploy_folder
from diagnosis import diagnose_many as many
from plant.effects.library import EFFECTS
from tests import made_up
from tests.logs import short_log

SHIPPED = sorted(path for path in deploy_folder().rglob("*.toml"))
CONTACT = {
    "stiffness_N_per_m": 1e8,
    "damping_Ns_per_m": 1e4,
    "coulomb_force_N": 10.0,
    "static_force_N": 12.0,
}


def call(*arguments: str):
    return CliRunner().invoke(app, list(arguments))


@cache
def validator(name: str) -> Any:
    """To make the schema takes longer than to use it."""
    return jsonschema.Draft202012Validator(FORMATS[name].schema())


def fits(name: str, value: Any) -> bool:
    """Whether a value fits a schema."""
    return validator(name).is_valid(value)


def check(name: str, value: Any) -> None:
    """Raise where a value does not fit a schema."""
    validator(name).validate(strict_json(value))


@pytest.mark.parametrize("name", FORMATS)
@pytest.mark.slow
def test_every_schema_is_one_and_is_printed(name: str) -> None:
    result = call("schema", name)
    assert result.exit_code == 0, result.output
    made = json.loads(result.stdout)
    jsonschema.Draft202012Validator.check_schema(made)
    assert json.loads(call("schema", name, "--json").stdout) == made


@pytest.mark.parametrize("name", FORMATS)
def test_the_shipped_schemas_are_those_that_are_printed(name: str) -> None:
    """After a change of a format: `make schemas`."""
    assert json.loads((deploy_folder() / "schemas" / f"{name}.json").read_text()) == FORMATS[name].schema()


def test_no_other_schema_is_shipped() -> None:
    assert {path.stem for path in (deploy_folder() / "schemas").iterdir()} == FORMATS.keys()


@pytest.mark.parametrize("path", SHIPPED, ids=lambda path: f"{path.parent.name}/{path.name}")
@pytest.mark.slow
def test_a_shipped_file_names_its_schema_and_fits_it(path: Path) -> None:
    word, _, place = path.read_text().partition("\n")[0].partition(" ")
    assert word == "#:schema"
    schema = json.loads((path.parent / place).read_text())
    folder = {"tests": "scenario", "faults": "scenario"}.get(path.parent.name, path.parent.name)
    assert schema["title"] in {folder, folder.removesuffix("s")}
    jsonschema.validate(tomllib.loads(path.read_text()), schema, jsonschema.Draft202012Validator)


@pytest.mark.parametrize(
    ("name", "table", "expected"),
    [
        ("rig", {"contact": {"pair": "C45-C45 @ 0.063", "static_force_N": 18}}, True),
        ("rig", {"contact": CONTACT}, True),
        ("rig", {"contact": CONTACT | {"stiffness": 1.0}}, False),
        ("rig", {"contact": {"static_force_N": 18.0}}, False),
        ("rig", {"contact": {"pair": "ice"}}, False),
        ("rig", {"contact": CONTACT, "effects": {"drive-backlash": {"gap_m": 1e-4}}}, True),
        ("rig", {"contact": CONTACT, "effects": {"drive-backlash": {"gap": 1e-4}}}, False),
        ("rig", {"contact": CONTACT, "effects": {"static-friction-ageing": {"form": "power", "ratio": 0.1}}}, True),
        ("rig", {"contact": CONTACT, "effects": {"static-friction-ageing": {"form": "linear"}}}, False),
        ("rig", {"contact": CONTACT, "effects": {"ghost": {}}}, False),
        ("scenario", {"rig": {"file": "paper-c45-c45", "slide": {"mass_kg": 2.0}}}, True),
        ("scenario", {"rig": {"file": "paper-c45-c45", "slide": {"mass": 2.0}}}, False),
        ("scenario", {"rig": {"file": "paper-c45-c45"}, "controller": {"limits": {"v_ratio": 0.9}}}, False),
        ("scenario", {"duration_s": 3.0}, False),
        ("controller", {"policy": {"enabled_from_s": 8}}, True),
        ("controller", {"policy": {"enabled_from": 8}}, False),
        ("import-map", {"channels": {"t_s": "Zeit [s]", "drive_force_N": {"column": "F", "scale": -1.0}}}, True),
        ("import-map", {"channels": {"force": "F"}}, False),
        ("import-map", {"channels": {"drive_force_N": {"scale": 2.0}}}, False),
        ("evidence-1", tomllib.loads(made_up.MANIFEST), True),
        ("evidence-1", tomllib.loads(made_up.MANIFEST) | {"format": "evidence/2"}, False),
    ],
)
def test_a_schema_accepts_the_same_values_as_the_program(name: str, table: dict[str, Any], expected: bool) -> None:
    assert fits(name, table) is expected


@pytest.mark.slow
def test_every_effect_with_its_defaults_fits_the_schema_of_a_rig() -> None:
    for name, effect in EFFECTS.items():
        for form, rows in effect.forms.items():
            numbers = {row.name: row.default for row in rows.parameters}
            check("rig", {"contact": CONTACT, "effects": {name: {"form": form} | numbers}})


def test_a_diagnosis_fits_and_one_more_key_does_not(tmp_path: Path) -> None:
    folder = tmp_path / "rig"
    made_up.evidence_folder(folder)
    source = many.find_sources([folder])[0]
    diagnosis = made_up.diagnosis()
    table = strict_json(diagnosis)
    check("diagnosis-3", table)
    assert not fits("diagnosis-3", table | {"more": 1})
    outcomes = [
        many.FolderResult(source, diagnosis, None),
        many.FolderResult(source, None, many.FolderFault("BAD_EVIDENCE", "why")),
    ]
    check("diagnoses-3", diagnose_output.Diagnoses(outcomes))


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("run-result", ["run", "--in-process", "--set", "duration_s=0.05"]),
        (
            "run-result",
            ["run", "--in-process", "--set", "duration_s=0.05", "--set", "rig.effects.drive-backlash.gap_m=1e-4"],
        ),
        ("replay-result", ["replay", "run.mcap"]),
        ("replay-result", ["replay", "run.mcap", "--set", "limits.v_ratio=1.5"]),
        ("closed-loop-result", ["replay", "run.mcap", "--closed-loop"]),
        ("plot-result", ["plot", "run.mcap"]),
        ("review-result", ["review", "run.mcap"]),
        pytest.param("map-result", ["map"], marks=pytest.mark.slow),
        ("log-info-result", ["log", "info", "run.mcap"]),
        ("log-check-result", ["log", "check", "run.mcap"]),
        ("log-recover-result", ["log", "recover", "run.mcap"]),
        ("log-export-result", ["log", "export", "run.mcap", "--to", "x.csv"]),
        ("scenarios-result", ["scenarios"]),
        ("scenarios-result", ["scenarios", "--copy", "stop-and-go"]),
        ("explain-result", ["explain"]),
        ("schema-result", ["schema"]),
        ("fault", ["log", "info", "no.mcap"]),
        ("fault", ["log", "infos"]),
    ],
)
def test_results_fit(name: str, arguments: list[str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "run.mcap").write_bytes(short_log())
    check(name, json.loads(call(*arguments, "--json").stdout))


class Inner(NamedTuple):
    """A result inside of another."""

    size: float
    secret: Path
    JSON_HIDDEN = ("secret",)

    @in_json
    def double(self) -> float:
        return 2.0 * self.size


class Outer(NamedTuple):
    """A result with each difference between its fields and its JSON."""

    inner: Inner
    rows: tuple[Inner, ...]
    place: Path
    note: str | None = None
    JSON_MERGED = "inner"
    JSON_OPTIONAL = ("note",)


def test_json_and_schema_follow_the_same_declarations() -> None:
    inner = Inner(math.nan, Path("secret"))
    table = strict_json(Outer(inner, (inner,), Path("a")))
    assert table == {"double": None, "size": None, "rows": [{"double": None, "size": None}], "place": "a"}
    fitting = jsonschema.Draft202012Validator(schema_of(Outer))
    assert fitting.is_valid(table)
    assert fitting.is_valid(table | {"note": "text"})
    wrong = ({"note": None}, {"secret": "x"}, {"inner": {}}, {"place": 1})
    assert not any(fitting.is_valid(table | more) for more in wrong)
    assert not any(fitting.is_valid({key: table[key] for key in table if key != left_out}) for left_out in table)


def test_without_a_name_they_are_listed_and_with_a_folder_written(tmp_path: Path) -> None:
    lines = call("schema").stdout.splitlines()
    assert [line.split()[0] for line in lines] == [name.name for name in (*TOML, *JSON)]
    assert call("schema", "--out", str(tmp_path / "all")).exit_code == 0
    assert {path.stem for path in (tmp_path / "all").iterdir()} == FORMATS.keys()
    written = call("schema", "rig", "--out", str(tmp_path / "one"))
    assert (written.exit_code, written.stdout) == (0, f"written  {tmp_path / 'one' / 'rig.json'}\n")
    assert [path.name for path in (tmp_path / "one").iterdir()] == ["rig.json"]


def test_a_format_goes_by_the_name_in_its_files_too() -> None:
    assert call("schema", "diagnosis/3").stdout == call("schema", "diagnosis-3").stdout
    result = call("schema", "rigs")
    assert result.exit_code == 2
    assert "rigs: no such schema; known: rig, scenario" in result.stderr
