"""Evidence that tests share is of the sources that are there, whatever was kept."""

import pytest

from diagnosis.synthetic.folder import Case, make_evidence
from diagnosis.synthetic.runs import RunPlan
from tests.made_evidence import MAKERS, digest_of, made_evidence

MOMENT = (RunPlan(((0.0, 0.002),), duration_s=1.0),)


def test_the_evidence_is_made_once_and_equals_fresh_evidence(tmp_path):
    kept = made_evidence(Case(MOMENT), 4)
    make_evidence(tmp_path, Case(MOMENT), 4)
    assert {path.name: path.read_bytes() for path in kept.iterdir()} == {
        path.name: path.read_bytes() for path in tmp_path.iterdir()
    }
    assert made_evidence(Case(MOMENT), 4) == kept
    others = {
        made_evidence(Case(MOMENT), 5),
        made_evidence(Case(MOMENT, {"drive-damping": {"damping_Ns_per_m": 3.0}}), 4),
        made_evidence(Case((RunPlan(((0.0, 0.001),), duration_s=1.0),)), 4),
    }
    assert len(others - {kept}) == 3


@pytest.mark.parametrize("place", MAKERS)
def test_an_edit_of_its_generator_is_seen(tmp_path, place):
    def checkout(name: str, text: str) -> str:
        root = tmp_path / name
        (root / place / "deep").mkdir(parents=True)
        (root / "requirements.lock").write_text("numpy==2.2")
        (root / place / "deep" / "part.py").write_text(text)
        return digest_of(root)

    assert checkout("one", "A = 1") == checkout("same", "A = 1")
    assert checkout("other", "A = 2") != checkout("one-more", "A = 1")
