"""A rig as an FMU: valid, equal to the plant's kernel in every bit, states, and refused calls. FMPy is an extra."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from cockpit.run.scenario import load_rig
from plant.config import RigConfig
from plant.core import advance, advance_disturbed
from plant.fmu.export import export
from plant.records import TRUTH, build, set_load
from tests.effects_rig import rig
from tests.truth.test_both_directions import FORMS, SIZES

fmpy = pytest.importorskip("fmpy", reason="make nightly installs the extra")
validation, fmi3 = pytest.importorskip("fmpy.validation"), pytest.importorskip("fmpy.fmi3")

CHANNELS, SLIDE = [5, 6, 7, 8, 9], 10 + TRUTH.index("true_velocity_mps")
DRIVE_MPS, FREQUENCY_HZ = 5e-4, 5000.0


class Model:
    """One instance of an FMU."""

    def __init__(self, path: Path, folder: Path) -> None:
        about = fmpy.read_model_description(str(path))
        fmpy.extract(str(path), str(folder))
        self.instance: Any = fmi3.FMU3Slave(
            guid=about.guid,
            unzipDirectory=str(folder),
            modelIdentifier=about.coSimulation.modelIdentifier,
            instanceName="rig",
        )
        self.instance.instantiate()
        self.instance.enterInitializationMode()
        self.instance.exitInitializationMode()
        self.block = 0

    def step(self, amplitude_m: float) -> bytes:
        """The next block: its channels and the slide's velocity."""
        self.instance.setFloat64([1, 2, 3], [DRIVE_MPS, FREQUENCY_HZ, amplitude_m])
        self.instance.doStep(self.block * 1e-3, 1e-3)
        self.block += 1
        return np.array(self.instance.getFloat64([*CHANNELS, SLIDE], nValues=120)).tobytes()


class Kernel:
    """The same, of the kernel that Python calls."""

    def __init__(self, config: RigConfig) -> None:
        self.params, self.state = build(config)
        self._step = advance_disturbed if self.params[0].disturbed else advance
        self._analogue, self._truth = np.zeros((5, 20)), np.zeros((6, 20))

    def step(self, amplitude_m: float) -> bytes:
        """The next block."""
        self._step(self.params, self.state, DRIVE_MPS, FREQUENCY_HZ, amplitude_m, self._analogue, self._truth)
        return self._analogue.tobytes() + self._truth[TRUTH.index("true_velocity_mps")].tobytes()


def vibration(block: int, blocks: int) -> float:
    return 3e-8 if blocks // 3 < block < 2 * blocks // 3 else 0.0


def differing(path: Path, config: RigConfig, folder: Path, blocks: int) -> int:
    """Number of blocks in which FMU and kernel differ."""
    model, kernel = Model(path, folder), Kernel(config)
    return sum(
        model.step(amplitude_m) != kernel.step(amplitude_m)
        for amplitude_m in (vibration(i, blocks) for i in range(blocks))
    )


@pytest.fixture(scope="module")
def nominal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "rig.fmu"
    export(load_rig("paper-c45-c45", []), path)
    return path


@pytest.mark.slow
def test_it_is_valid_and_equal_to_the_kernel_in_every_bit(nominal: Path, tmp_path: Path) -> None:
    assert validation.validate_fmu(str(nominal)) == []
    assert differing(nominal, load_rig("paper-c45-c45", []), tmp_path, 10_000) == 0


@pytest.mark.slow
def test_a_load_acts_as_in_the_plant(nominal: Path, tmp_path: Path) -> None:
    config = load_rig("paper-c45-c45", [])
    model, kernel = Model(nominal, tmp_path), Kernel(config)
    model.instance.setFloat64([4], [1.5])
    set_load(kernel.params, config, 1.5)
    assert all(model.step(0.0) == kernel.step(0.0) for _ in range(2000))


@pytest.mark.slow
def test_a_state_that_is_set_back_gives_the_same_bits(nominal: Path, tmp_path: Path) -> None:
    model, other = Model(nominal, tmp_path), Model(nominal, tmp_path / "other")
    for block in range(500):
        model.step(vibration(block, 500))
    assert other.instance.getFloat64([5], nValues=20) == [0.0] * 20  # two instances are independent
    state = model.instance.getFMUState()
    kept = model.instance.serializeFMUState(state)
    first = [model.step(1e-8) for _ in range(100)]
    model.instance.setFMUState(state)
    model.block = 500
    assert [model.step(1e-8) for _ in range(100)] == first
    other.instance.setFMUState(other.instance.deserializeFMUState(kept))
    other.block = 500
    assert [other.step(1e-8) for _ in range(100)] == first


@pytest.mark.slow
def test_what_it_cannot_do_is_refused(nominal: Path, tmp_path: Path) -> None:
    instance = Model(nominal, tmp_path).instance
    for refused in (
        lambda: instance.doStep(0.0, 0.3e-3),
        lambda: instance.setFloat64([1], [float("nan")]),
        lambda: instance.setFloat64([5], [1.0]),
        lambda: instance.getFloat64([99]),
        lambda: instance.getFloat64([5], nValues=19),
    ):
        with pytest.raises(fmpy.fmi1.FMICallException):
            refused()
    instance.doStep(0.0, 0.02)  # 20 blocks at once


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "form"), FORMS)
def test_each_effect_is_equal_in_every_bit(name: str, form: str, tmp_path: Path) -> None:
    """The nominal kernel is covered above; both come from one source."""
    config = rig({name: {"form": form, **SIZES.get(name, {})}})
    export(config, tmp_path / "rig.fmu")
    assert differing(tmp_path / "rig.fmu", config, tmp_path / "open", 10_000) == 0


@pytest.mark.nightly
def test_a_thousand_instances_leave_no_memory(nominal: Path, tmp_path: Path) -> None:
    """Covered in part by the two instances above."""

    def used_MB() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096e-6

    model = Model(nominal, tmp_path)
    before_MB = 0.0
    for count in range(1100):
        model.instance.fmi3FreeInstance(model.instance.component)  # FMPy's `freeInstance` also unloads the library
        model.instance.instantiate()
        before_MB = used_MB() if count == 100 else before_MB
    assert used_MB() < before_MB + 5.0
