"""The physics of the simulated rig as a device: the twin of `plant.step`, without a guard. It has the true vibration."""

from pathlib import Path

import numpy as np

from bridge.arrays import Records
from bridge.rig.device import Device, DeviceBlock, Setup
from bridge.wire.channels import CHANNELS
from bridge.wire.messages import sensor_block
from plant.config import RigConfig
from plant.inputs import RigInputs
from plant.piezo import base_velocity_mps
from plant.records import TRUTH, build
from plant.step import vibrate


class PlantDevice(Device):
    """A simulated converter and exciter; a call of `read` makes a block.

    Args:
        config: the rig file. Its `loop` delays do not act: they belong to the way of a command to the guard.
        seed: seed of the sensor noise.

    """

    pace = "computer"

    def __init__(self, config: RigConfig, seed: int) -> None:
        solver = config.solver
        rate_Hz = solver.samples_per_block / solver.block_s
        super().__init__(Setup({}, Path(), rate_Hz, solver.samples_per_block, len(CHANNELS), has_enable_line=True))
        self.block_s = solver.block_s
        self.params, self._state = build(config)
        self._inputs = RigInputs(config, seed)
        self._sensors = sensor_block(solver.samples_per_block).blank()
        self._analogue = np.zeros((len(CHANNELS), solver.samples_per_block))
        self.truth = np.empty((len(TRUTH), solver.samples_per_block))  # of the last block, rows as plant.records.TRUTH
        self._frequency_Hz, self._amplitude_m, self._is_on = config.piezo.frequency_max_Hz, 0.0, False
        self._drawn = self._inputs.draw(1)

    def open(self) -> None:
        """A simulated device is there."""

    def announcements(self) -> Records:
        """Coming velocities of the drive."""
        return self._drawn.announce

    def enable(self, on: bool, toggle: int) -> None:  # noqa: ARG002
        """Set the enable line; this device has no watchdog."""
        self._is_on = on

    def write(self, frequency_Hz: float, amplitude: float) -> None:
        """Set the vibration of the next block."""
        self._frequency_Hz, self._amplitude_m = frequency_Hz, amplitude

    def read(self) -> DeviceBlock:
        """The next block."""
        amplitude_m = self._amplitude_m if self._is_on or self.params[0].always_on else 0.0
        drive_mps, noise = self._drawn.velocity_mps[0], self._drawn.noise[0]
        vibrate(
            self.params, self._state, drive_mps, self._frequency_Hz, amplitude_m, noise, self._analogue, self.truth,
            self._sensors,
        )  # fmt: skip
        state = self._state[0]
        state.block += 1
        self._drawn = self._inputs.draw(1)
        samples = np.array([self._sensors[name][0] for name in CHANNELS], np.float64)
        return DeviceBlock(samples, float(state.frequency_Hz), float(state.amplitude_m))

    @property
    def vibration_mps(self) -> float:
        """The true velocity amplitude v_a of the base at the end of the last block [m/s]."""
        return base_velocity_mps(self.params[0], self._state[0])

    def safe(self) -> None:
        """Let the vibration fade at the exciter's rate."""
        self._amplitude_m = 0.0

    def close(self) -> None:
        """A simulated device has no connection."""
