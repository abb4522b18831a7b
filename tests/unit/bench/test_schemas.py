"""The files of the bench fit their schemas, and the kept schemas match the code."""

import json
import tomllib
from pathlib import Path

import jsonschema
import pytest

from bench.schemas import FOLDER, FORMATS

FAMILIES = sorted((FOLDER.parent / "control" / "scenarios").glob("*.toml"))


@pytest.mark.slow
def test_the_kept_schemas_match_the_code() -> None:
    """After a change of a format: `make schemas`."""
    kept = {path.stem: json.loads(path.read_text()) for path in FOLDER.iterdir()}
    assert kept == {name: table.schema() for name, table in FORMATS.items()}
    for schema in kept.values():
        jsonschema.Draft202012Validator.check_schema(schema)


@pytest.mark.parametrize("path", FAMILIES, ids=lambda path: path.stem)
@pytest.mark.slow
def test_a_family_of_the_bank_names_its_schema_and_fits_it(path: Path) -> None:
    word, _, place = path.read_text().partition("\n")[0].partition(" ")
    assert word == "#:schema"
    schema = json.loads((path.parent / place).read_text())
    assert schema["title"] == "bank"
    jsonschema.validate(tomllib.loads(path.read_text()), schema, jsonschema.Draft202012Validator)
