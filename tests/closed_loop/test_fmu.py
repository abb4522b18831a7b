"""Rigs and controllers as FMUs: valid, equal to the kernel in every bit, states, refused calls. FMPy is an extra."""

import re
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from typer.testing import CliRunner

from bridge.fmu.export import export
from bridge.log.logfile import read_run
from bridge.wire.channels import CHANNELS as CHANNEL_NAMES
from bridge.wire.messages import BLOCK
from cockpit.cli import app
from cockpit.run.run import about_run
from cockpit.run.scenario import load_rig, load_scenario
from cockpit.run.simulated.run import simulate
from controller.announced import MOST_ANNOUNCED
from controller.fmu import OF_GUARD
from controller.fmu import model as model_of_controller
from plant.config import RigConfig
from plant.core import advance, advance_disturbed
from plant.fmu import model
from plant.records import TRUTH, build, set_load
from tests.effects_rig import rig
from tests.truth.test_both_directions import FORMS, SIZES

fmpy: Any = pytest.importorskip("fmpy", reason="make nightly installs the extra")
validation, fmi2, fmi3 = (pytest.importorskip(f"fmpy.{name}") for name in ("validation", "fmi2", "fmi3"))

CHANNELS, SLIDE = [5, 6, 7, 8, 9], 10 + TRUTH.index("true_velocity_mps")
DRIVE_MPS, FREQUENCY_HZ = 5e-4, 5000.0


class Fmu:
    """One instance of an FMU."""

    def __init__(self, path: Path, folder: Path) -> None:
        about = fmpy.read_model_description(str(path))
        fmpy.extract(str(path), str(folder))
        self.references = {variable.name: variable.valueReference for variable in about.modelVariables}
        kind: Any = fmi2.FMU2Slave if about.fmiVersion == "2.0" else fmi3.FMU3Slave
        self.instance: Any = kind(
            guid=about.guid,
            unzipDirectory=str(folder),
            modelIdentifier=about.coSimulation.modelIdentifier,
            instanceName="rig",
        )
        self.instance.instantiate()
        if about.fmiVersion == "2.0":
            self.instance.setupExperiment()
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
    fmu, kernel = Fmu(path, folder), Kernel(config)
    return sum(
        fmu.step(amplitude_m) != kernel.step(amplitude_m)
        for amplitude_m in (vibration(i, blocks) for i in range(blocks))
    )


@pytest.fixture(scope="module")
def nominal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("fmu") / "rig.fmu"
    export(model(load_rig("paper-c45-c45", [])), path)
    return path


@pytest.mark.slow
def test_it_is_valid_and_equal_to_the_kernel_in_every_bit(nominal: Path, tmp_path: Path) -> None:
    assert validation.validate_fmu(str(nominal)) == []
    assert differing(nominal, load_rig("paper-c45-c45", []), tmp_path, 10_000) == 0


@pytest.mark.slow
def test_fmi_2_has_the_last_values_and_the_means(tmp_path: Path) -> None:
    path, config = tmp_path / "rig.fmu", load_rig("paper-c45-c45", [])
    export(model(config), path, fmi=2)
    assert validation.validate_fmu(str(path)) == []
    fmu, kernel = Fmu(path, tmp_path / "open"), Kernel(config)
    inputs = [fmu.references[name] for name in ("drive_velocity_mps", "frequency_Hz", "amplitude_m")]
    for block in range(300):
        fmu.instance.setReal(inputs, [DRIVE_MPS, FREQUENCY_HZ, vibration(block, 300)])
        fmu.instance.doStep(block * 1e-3, 1e-3)
        block_N = np.frombuffer(kernel.step(vibration(block, 300)))[:20]
        names = [fmu.references[name] for name in ("drive_force_N", "drive_force_N_mean")]
        last_N, mean_N = fmu.instance.getReal(names)
        assert last_N == block_N[-1]
        assert mean_N == pytest.approx(block_N.mean(), rel=1e-14)


@pytest.mark.slow
def test_it_needs_no_package_of_python(nominal: Path, tmp_path: Path) -> None:
    fmpy.extract(str(nominal), str(tmp_path))
    [library] = tmp_path.rglob("*.so")
    script = "import ctypes, sys; f = ctypes.CDLL(sys.argv[1]).fmi3GetVersion; f.restype = ctypes.c_char_p; print(f())"
    done = subprocess.run(
        [sys.executable, "-I", "-S", "-c", script, str(library)], capture_output=True, text=True, check=False
    )
    assert done.stdout == "b'3.0'\n", done.stderr
    needed = subprocess.run(["readelf", "-d", str(library)], capture_output=True, text=True, check=True).stdout
    assert set(re.findall(r"NEEDED.*\[(.*?)\.so", needed)) <= {"libc", "libm"}


@pytest.mark.slow
def test_a_load_acts_as_in_the_plant(nominal: Path, tmp_path: Path) -> None:
    config = load_rig("paper-c45-c45", [])
    fmu, kernel = Fmu(nominal, tmp_path), Kernel(config)
    fmu.instance.setFloat64([4], [1.5])
    set_load(kernel.params, config, 1.5)
    assert all(fmu.step(0.0) == kernel.step(0.0) for _ in range(2000))


@pytest.mark.slow
def test_a_state_that_is_set_back_gives_the_same_bits(nominal: Path, tmp_path: Path) -> None:
    fmu, other = Fmu(nominal, tmp_path), Fmu(nominal, tmp_path / "other")
    for block in range(500):
        fmu.step(vibration(block, 500))
    assert other.instance.getFloat64([5], nValues=20) == [0.0] * 20  # two instances are independent
    state = fmu.instance.getFMUState()
    kept = fmu.instance.serializeFMUState(state)
    first = [fmu.step(1e-8) for _ in range(100)]
    fmu.instance.setFMUState(state)
    fmu.block = 500
    assert [fmu.step(1e-8) for _ in range(100)] == first
    other.instance.setFMUState(other.instance.deserializeFMUState(kept))
    other.block = 500
    assert [other.step(1e-8) for _ in range(100)] == first


@pytest.mark.slow
def test_what_it_cannot_do_is_refused(nominal: Path, tmp_path: Path) -> None:
    instance = Fmu(nominal, tmp_path).instance
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
    words = ["fmu", "paper-c45-c45", "--controller", "--fmi", "2", "--out", str(tmp_path / "c.fmu")]
    assert CliRunner().invoke(app, words).exit_code == 2


@pytest.mark.nightly
@pytest.mark.parametrize(("name", "form"), FORMS)
def test_each_effect_is_equal_in_every_bit(name: str, form: str, tmp_path: Path) -> None:
    """The nominal kernel is covered above; both come from one source."""
    config = rig({name: {"form": form, **SIZES.get(name, {})}})
    export(model(config), tmp_path / "rig.fmu")
    assert differing(tmp_path / "rig.fmu", config, tmp_path / "open", 10_000) == 0


@pytest.mark.nightly
def test_a_thousand_instances_leave_no_memory(nominal: Path, tmp_path: Path) -> None:
    """Covered in part by the two instances above."""

    def used_MB() -> float:
        return int(Path("/proc/self/statm").read_text().split()[1]) * 4096e-6

    fmu = Fmu(nominal, tmp_path)
    before_MB = 0.0
    for count in range(1100):
        fmu.instance.fmi3FreeInstance(fmu.instance.component)  # FMPy's `freeInstance` also unloads the library
        fmu.instance.instantiate()
        before_MB = used_MB() if count == 100 else before_MB
    assert used_MB() < before_MB + 5.0


@pytest.mark.nightly
def test_a_controller_gives_the_commands_of_a_log(tmp_path: Path) -> None:
    """Its kernel compiles for 40 s. The rig announces its speed; blocks are lost, and an operator stops the run."""
    steps = "step=[{at_s=3.0, speed_mps=0.001}, {at_s=7.0, command='STOP'}]"
    lost = "fault=[{kind='cut', target='blocks', from_s=5.0, for_s=0.02}]"
    run = load_scenario("paper-c45-c45", ["arm=true", "duration_s=8.0", "rig.drive.announce_ahead_s=0.05", steps, lost])
    simulate(run, tmp_path / "run.mcap", about_run(run, lockstep=True))
    made = model_of_controller(run.name, run.controller)
    export(made, tmp_path / "controller.fmu")
    assert validation.validate_fmu(str(tmp_path / "controller.fmu")) == []
    log, fmu = read_run(tmp_path / "run.mcap"), Fmu(tmp_path / "controller.fmu", tmp_path / "open")
    assert len(log.trace) > 7900
    assert log.announce.size > 5
    assert log.trace["gap_blocks"].max() > 0
    blocks = {int(block["sequence"]): block for block in log.sensors}
    snapshots = {snapshot.step + 1: snapshot.memory for snapshot in log.snapshots}
    kinds = {variable.name: (variable.type, place) for place, variable in enumerate(made.variables, 1)}

    def put(values: dict[str, Any]) -> None:
        for name, value in values.items():
            getattr(fmu.instance, f"set{kinds[name][0]}")([kinds[name][1]], np.ravel(value).tolist())

    def got(name: str) -> list[Any]:
        kind, place = kinds[name]
        return getattr(fmu.instance, f"get{kind}")([place])

    def differ(message: str, record: Any) -> list[str]:
        names = [name for name in record.dtype.names if name != "lateness_ns"]
        return [name for name in names if [record[name].item()] != got(f"{message}.{name}")]

    announced, own_block, taken, compared = log.announce, (*CHANNEL_NAMES, *OF_GUARD, "sequence"), 0, 0
    ring = np.zeros(MOST_ANNOUNCED, np.int64), np.zeros(MOST_ANNOUNCED)
    for trace, command in zip(log.trace, log.command, strict=True):
        for row in announced[taken : trace["announcements"]]:
            ring[0][taken % MOST_ANNOUNCED], ring[1][taken % MOST_ANNOUNCED] = (
                row["holds_from_ns"],
                row["drive_velocity_mps"],
            )
            taken += 1
        put({"announced_from_ns": ring[0], "announced_mps": ring[1], "announced_count": taken})
        put({name: trace[name] for name in ("events", "gap_blocks", "t_ns")})
        if trace["events"] & BLOCK:
            put({name: blocks[int(trace["block"])][name] for name in own_block})
        fmu.instance.doStep(fmu.block * 1e-3, 1e-3)
        fmu.block += 1
        assert (differ("command", command), differ("trace", trace)) == ([], []), f"step {fmu.block}"
        if (memory := snapshots.get(fmu.block)) is not None:
            at = made.places()[1]
            kept = bytes(fmu.instance.serializeFMUState(fmu.instance.getFMUState()))
            assert kept[at : at + len(memory)] == memory
            compared += 1
    assert compared > 5
