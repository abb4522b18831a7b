"""Models of other tools as devices: the same tests run on an FMU; a bad one is named, and nothing vibrates. FMPy is an extra."""

import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bridge.faults import Fault
from bridge.rig.real import open_node
from cockpit.run.scenario import load_rig
from cockpit.run.scenario_file import deploy_folder
from cockpit.testing.suite import cases_of, run_tests
from cockpit.testing.target import Target
from plant.fmu import export as exporting
from tests.unit.bridge.rig.boxes import rig_file, table, toml

pytest.importorskip("fmpy", reason="make nightly installs the extra")
CHANNELS = ["drive_force_N", "mass_accel_mps2", "base_accel_mps2", "mass_position_m", "drive_position_m"]
NOISE = dict(zip(CHANNELS, (0.01, 0.2, 0.2, 5e-7, 5e-7), strict=True))
STEP = "void stickslip_block(void *p, void *s, double v, double f, double a, double *analogue, double *truth) "
BODIES = {  # a model's step, and the event or its text
    "crash": ("{ *(volatile int *)0 = 1; }", "MODEL_DIED", "ended by signal 11"),
    "hang": ('{ for (;;) { __asm__(""); } }', "MODEL_SLOW", "no block within 0.5 s"),
    "grows": (
        "{ for (;;) { char *m = malloc(1 << 20); if (!m) abort(); m[0] = 1; } }",
        "MODEL_DIED",
        "ended by signal 6",
    ),
}


def device(file: str, **more: Any) -> dict[str, Any]:
    settings = {
        "file": file,
        "frequency": "frequency_Hz",
        "amplitude": "amplitude_m",
        "outputs": CHANNELS,
        "noise": NOISE,
    }
    return table(adapter="fmu", device=settings | {"set": {"drive_velocity_mps": 5e-4}} | more)


def written(folder: Path, **more: Any) -> Path:
    path = folder / "model.toml"
    path.write_text(toml(device("rig.fmu", **more)))
    return path


@pytest.fixture(scope="module")
def fmu(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "rig.fmu"
    exporting.export(load_rig("paper-c45-c45", []), path)
    return path


@pytest.mark.slow
def test_the_same_tests_run_on_a_model(fmu: Path, tmp_path: Path) -> None:
    """Two of them; the tests of a box run all that a device can run."""
    rig = written(fmu.parent)
    paths = [deploy_folder() / "tests" / f"{name}.toml" for name in ("stop", "kill")]
    cases, _ = cases_of(paths, [], Target(str(rig), arm=True))
    tests = run_tests(cases, 1, tmp_path, lambda _share: None)
    assert [test.result for test in tests] == ["PASSED"] * 2, [test.in_words() for test in tests]


@pytest.mark.slow
@pytest.mark.parametrize("name", BODIES)
def test_a_model_that_fails_is_named_and_the_exciter_rests(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    body, code, text = BODIES[name]
    step = tmp_path / "step.c"
    step.write_text(f"#include <stdlib.h>\n{STEP}{body}\n")
    monkeypatch.setattr(exporting, "_object_file", lambda *_: step)
    exporting.export(load_rig("paper-c45-c45", []), tmp_path / "rig.fmu")
    more = {"slowest_s": 0.5, "memory_MB": 1500.0}
    node = open_node(rig_file(**device("rig.fmu", **more)), tmp_path, 1)
    try:
        assert node.advance([]) == ()
        assert [(problem[0], text in problem[1]) for problem in node.problems()] == [(code, True)]
        assert node.applied["amplitude_m"] == 0.0
    finally:
        node.close()


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
        ({}, lambda files: {name: data for name, data in files.items() if name.endswith(".xml")}, "stickslip.so"),
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
