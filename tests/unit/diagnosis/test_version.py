"""The version of kept scores changes with code that changes answers, and not with comments and texts."""

import pytest

from diagnosis.version import definitions_digest

BEFORE = '''"""A note."""

import math

LIMIT = 3.0  # a number


def slip(force_N: float) -> float:
    """Say what it does."""
    return math.sqrt(force_N) * LIMIT


class Fit:
    """A fit."""

    chi2 = 0.0


ROW = Row(words="it rests", shown_by=("friction", "time_s"), forms={"": 0.1})
'''


def digest(tmp_path, **files: str) -> str:
    for name, text in files.items():
        path = tmp_path / "diagnosis" / name.replace("__", "/")
        path.parent.mkdir(parents=True, exist_ok=True)
        path.with_suffix(".py").write_text(text)
    return definitions_digest(tmp_path, ("diagnosis",), ("diagnosis/report",))


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("# a number", "# another word"),
        ("A note.", "Another note."),
        ("Say what it does.", "Say it better."),
        ('    """A fit."""\n', ""),
        ("import math", "import math\nimport os"),
        ("it rests", "it sleeps"),
        ('"time_s"', '"position_m"'),
    ],
)
def test_words_do_not_change_the_version(tmp_path, old, new):
    assert old in BEFORE
    assert digest(tmp_path / "a", fit=BEFORE) == digest(tmp_path / "b", fit=BEFORE.replace(old, new))


@pytest.mark.parametrize(
    ("old", "new"),
    [("3.0", "3.1"), ("* LIMIT", "/ LIMIT"), ("chi2 = 0.0", "chi2 = 0"), ("-> float", "-> int"), ("0.1}", "0.2}")],
)
def test_a_change_of_the_computation_changes_the_version(tmp_path, old, new):
    assert old in BEFORE
    assert digest(tmp_path / "a", fit=BEFORE) != digest(tmp_path / "b", fit=BEFORE.replace(old, new))


def test_the_place_of_a_definition_does_not_change_the_version(tmp_path):
    head, function = BEFORE.split("def slip")
    moved = digest(tmp_path / "b", fits__refit=head, fits__slips="def slip" + function)
    assert digest(tmp_path / "a", fit=BEFORE) == moved


def test_the_report_does_not_change_the_version(tmp_path):
    before = digest(tmp_path, fit=BEFORE)
    assert digest(tmp_path, report__page="WIDTH = 3\n") == before
    assert digest(tmp_path, gap__floor="WIDTH = 3\n") != before
