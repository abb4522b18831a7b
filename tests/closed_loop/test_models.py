"""Models of other tools as devices: the same tests run on an FMU; a bad one is named, and nothing vibrates. FMPy is an extra."""

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.fmu.export import export
from bridge.rig.real import open_node
from cockpit.run.scenario import load_rig
from cockpit.run.scenario_file import deploy_folder
from cockpit.testing.suite import cases_of, mutants_of, run_tests
from cockpit.testing.target import Target
from plant.fmu import model
from tests.closed_loop.foreign import foreign_fmu, rig_of
from tests.unit.bridge.rig.boxes import rig_file, table, toml

pytest.importorskip("fmpy", reason="make nightly installs the extra")
CHANNELS = ["drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m"]
NOISE = dict(zip(CHANNELS, (0.02, 0.0015, 0.0015, 5e-7, 5e-7), strict=True))  # as of the paper's rig
SCENARIO = 'duration_s = {duration_s}\narm = true\n\n[rig]\nfile = "{rig}"\n'


def device(file: str, **more: Any) -> dict[str, Any]:
    settings = {
        "file": file,
        "frequency": "frequency_Hz",
        "amplitude": "amplitude_m",
        "outputs": CHANNELS,
        "noise": NOISE,
        "speed": "drive_velocity_mps",
        "load": "load",
        "set": {"drive_velocity_mps": 5e-4, "load": 1.0},
    }
    return table(adapter="fmu", device=settings | more)


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "rig.fmu"
    export(model(load_rig("paper-c45-c45", [])), path)
    path.with_suffix(".toml").write_text(toml(device("rig.fmu")))
    return path


def results(paths: list[Path], rig: Path | None, folder: Path, mutants: bool = False) -> dict[str, str]:
    """Result of each test, with its lines if it did not pass."""
    cases, _ = cases_of(paths, [], Target(str(rig or ""), arm=True))
    cases = mutants_of(cases)[0] if mutants else cases
    tests = run_tests(cases, 1, folder, lambda _share: None)
    return {
        f"{test.name} {test.defect}": test.result if mutants or test.result == "PASSED" else str(test.in_words())
        for test in tests
    }


@pytest.mark.slow
def test_the_same_tests_run_on_a_model(fmu: Path, tmp_path: Path) -> None:
    """Three of them; `make nightly` has all."""
    paths = [deploy_folder() / "tests" / f"{name}.toml" for name in ("kill", "clip", "speed-step")]
    assert set(results(paths, fmu.with_suffix(".toml"), tmp_path).values()) == {"PASSED"}


@pytest.mark.nightly
@pytest.mark.parametrize(("mutants", "result"), [(False, "PASSED"), (True, "FAILED")])
def test_all_tests_run_on_a_model(mutants: bool, result: str, fmu: Path, tmp_path: Path) -> None:
    """Covered by the three above."""
    found = results([deploy_folder() / "tests"], fmu.with_suffix(".toml"), tmp_path, mutants)
    assert len(found) >= 20
    assert {name: text for name, text in found.items() if text != result} == {}


def scenario(folder: Path, rig: Path, duration_s: float, expectations: str) -> Path:
    path = folder / f"{rig.stem}.toml"
    path.write_text(SCENARIO.format(duration_s=duration_s, rig=rig) + expectations)
    return path


@pytest.mark.slow
def test_a_model_of_another_author_is_controlled(tmp_path: Path) -> None:
    """Millimetres, g, steps of half a block, and names with spaces: one rig file."""
    rig = rig_of(foreign_fmu(tmp_path / "foreign.fmu"))
    (tmp_path / "test").mkdir()
    test = scenario(
        tmp_path / "test", rig, 8.0,
        "[[expect]]\nslips = 0\nfrom_s = 6.0\n\n"
        '[[expect]]\nsignal = "velocity_ratio"\nwithin = [1.1, 1.6]\nfrom_s = 6.0\n\n'
        "[[expect]]\nslips = [1, 9]\nto_s = 5.0\nin_charge = false\n\n[controller.policy]\nenabled_from_s = 5.0\n",
    )  # fmt: skip
    assert results([test], rig, tmp_path) == {"foreign ": "PASSED"}


@pytest.mark.slow
def test_models_that_fail_are_named_and_nothing_vibrates(tmp_path: Path) -> None:
    """Each fails 1 s after its start, under a vibration; the run of the tests goes on."""
    (tmp_path / "test").mkdir()
    faults = {
        "crash": (1, "MODEL_DIED"),
        "hang": (2, "MODEL_SLOW"),
        "grows": (3, "MODEL_DIED"),
        "nan": (4, "NOT_FINITE"),
        "error": (5, "MODEL_DIED"),
    }
    for name, (fault, event) in faults.items():
        start = {"carriage speed": 0.5, "load": 1.0, "fault": fault}
        slowest_s = 0.5 if name == "hang" else 20.0
        rig = rig_of(foreign_fmu(tmp_path / f"{name}.fmu"), set=start, slowest_s=slowest_s)
        amplitude = '[[expect]]\nsignal = "amplitude_m"\n'
        expectations = f'[[expect]]\nevent = "{event}"\nfrom_s = 0.9\nwithin_s = 0.3\n\n'
        expectations += f'{amplitude}at_least = "5 nm"\nfrom_s = 0.5\nto_s = 0.9\n\n'
        expectations += f'{amplitude}at_most = "0.01 nm"\nfrom_s = 1.3\n' if name == "nan" else ""
        scenario(tmp_path / "test", rig, 2.4, expectations)
    assert set(results([tmp_path / "test"], None, tmp_path).values()) == {"PASSED"}


def _edited(old: str, new: str) -> Callable[[dict[str, bytes]], dict[str, bytes]]:
    def edit(files: dict[str, bytes]) -> dict[str, bytes]:
        return {
            name: data.replace(old.encode(), new.encode()) if name.endswith(".xml") else data
            for name, data in files.items()
        }

    return edit


@pytest.mark.slow
@pytest.mark.parametrize(
    ("more", "edit", "line"),
    [
        ({"frequency": "f"}, dict, "f: no such variable; known: time"),
        ({}, _edited('start="20"', 'start="7"'), "outputs of 7 samples: must all have one number that divides 20"),
        ({}, _edited('fmiVersion="3.0"', 'fmiVersion="1.0"'), "must be a model of FMI 2.0 or 3.0"),
        (
            {},
            lambda files: {name: data for name, data in files.items() if name.endswith(".xml")},
            "no binary for Linux",
        ),
        ({}, lambda _files: {}, "modelDescription.xml"),
    ],
)
def test_a_model_that_does_not_fit_is_refused_at_its_start(
    more: dict[str, Any], edit: Callable[[dict[str, bytes]], dict[str, bytes]], line: str, fmu: Path, tmp_path: Path
) -> None:
    with zipfile.ZipFile(fmu) as archive:
        files = {name: archive.read(name) for name in archive.namelist()}
    with zipfile.ZipFile(tmp_path / "rig.fmu", "w") as archive:
        for name, data in edit(files).items():
            archive.writestr(name, data)
    with pytest.raises(Fault) as refused:
        open_node(rig_file(**device("rig.fmu", **more)), tmp_path, 1)
    assert refused.value.kind.code == "NO_DEVICE"
    assert line in refused.value.line


@pytest.mark.slow
def test_noise_comes_from_the_seed(fmu: Path) -> None:
    def block(seed: int) -> np.ndarray:
        node = open_node(rig_file(**device("rig.fmu", seed=seed, resolution={"drive_position_m": 1e-6})), fmu.parent, 1)
        try:
            return np.frombuffer(node.advance([])[0].payload, np.uint8)
        finally:
            node.close()

    assert np.array_equal(block(1), block(1))
    assert not np.array_equal(block(1), block(2))
