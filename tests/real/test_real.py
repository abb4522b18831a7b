"""Robust results of the diagnosis on measured logs; its errors are in docs/quality/results.md."""

from pathlib import Path

import numpy as np
import pytest

from diagnosis.diagnose import diagnose
from diagnosis.evidence.folder import load_evidence
from diagnosis.result import Diagnosis
from tests.real.evidences import AXIS, EVIDENCES, MISSING, SLIDER, Cut, Levels, slider
from tests.real.known import known
from tests.real.table import lines

pytestmark = pytest.mark.skipif(not (SLIDER.is_dir() and AXIS.is_dir()), reason=MISSING)


def diagnosed(folder: Path) -> Diagnosis:
    diagnosis = diagnose(load_evidence(folder), lambda *_: None, jobs=2)
    assert lines(diagnosis)[0].startswith("verdict")
    return diagnosis


@pytest.mark.slow
def test_known_properties_are_found_in_the_logs() -> None:
    said = known()
    wavelengths_mm = [float(line.split(" mm")[0].split()[-1]) for line in said[:5]]
    assert all(3.4 < wavelength_mm < 4.4 for wavelength_mm in wavelengths_mm)  # published with the data: 3.7 to 4.3 mm
    left_N = [float(line.split()[-3]) for line in said[5:]]
    assert left_N == sorted(left_N, reverse=True)
    offset_N = float(said[6].split("(")[1].split(")")[0])
    assert offset_N == pytest.approx(-3.16, abs=0.3)


@pytest.mark.parametrize("name", EVIDENCES)
def test_every_evidence_is_read_without_a_doubt(name: str, tmp_path: Path) -> None:
    EVIDENCES[name](tmp_path)
    evidence = load_evidence(tmp_path)
    assert {finding.kind for finding in evidence.findings} == {"missing"}
    assert {run.holdout for run in evidence.runs} == {False, True}
    assert all(np.isfinite(run.columns["drive_force_N"]).all() for run in evidence.runs)


@pytest.mark.nightly
def test_the_wave_of_the_track_leads_on_the_stiff_spring(tmp_path: Path) -> None:
    EVIDENCES["slider-stiff"](tmp_path)
    effects = [candidate for candidate in diagnosed(tmp_path).candidates if candidate.effect != "none"]
    # at one speed a wave of the track and one of the load in time are the same
    assert {effect.effect for effect in effects[:2]} == {"position-dependent-friction", "normal-load-fluctuation"}
    sizes = effects[0].parameters
    wavelength_m = sizes["wavelength_m"].value if "wavelength_m" in sizes else 1.1e-3 / sizes["frequency_Hz"].value
    assert 0.0034 < wavelength_m < 0.0044


@pytest.mark.nightly
def test_no_effect_is_sure_where_noise_hides_the_slips(tmp_path: Path) -> None:
    cuts = (Cut("k2254Nm_v42", 4.2e-5, 0.0, 8.0), Cut("k2254Nm_v42", 4.2e-5, 8.0, 16.0, holdout=True))
    slider(tmp_path, 2254.0, Levels(0.40, 0.367), cuts)
    diagnosis = diagnosed(tmp_path)
    assert diagnosis.verdict != "effect"
    assert (
        max(
            diagnosis.complete * candidate.probability
            for candidate in diagnosis.candidates
            if candidate.effect != "none"
        )
        < 0.8
    )
