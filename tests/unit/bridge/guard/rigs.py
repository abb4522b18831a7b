"""A guard and its inputs, for tests: blocks of 1 ms with 20 samples, an exciter of 100 nm and 0.5 to 5 kHz."""

import math
from typing import Any

import numpy as np

from bridge.guard.config import GuardConfig, Level
from bridge.guard.core import accept, allow, look
from bridge.guard.records import ExciterLimits, build
from bridge.wire.messages import COMMAND, sensor_block

RUN = 77
EXCITER = ExciterLimits(1e-7, 500.0, 5000.0, 1e-6, 1e-3, 20, 0.05)
# limits of every rig here: a drive of up to 1 mm/s, v_a of the full stroke at the highest frequency
ABSOLUTE = {"fastest_drive_mps": 1e-3, "velocity_mps": Level(alarm=3.15e-3, abort=4.72e-3)}
SAMPLE_S = 5e-5
NANO = 1e-9


def real(config: GuardConfig) -> GuardConfig:
    """The limits, with the absolute ones that a real rig must give."""
    missing = {name: value for name, value in ABSOLUTE.items() if getattr(config, name) is None}
    return config.model_copy(update=missing)


class Rig:
    """A rig whose drive moves evenly and whose base vibrates with `gain` times the amplitude that the guard allows."""

    def __init__(
        self,
        config: GuardConfig | None = None,
        arm: bool = True,
        exciter: ExciterLimits = EXCITER,
        absent: tuple[str, ...] = (),
    ) -> None:
        self.params, self.state = build(real(config or GuardConfig()), exciter, RUN, arm, absent)
        self.p: Any = self.params[0]
        self.s: Any = self.state[0]
        self.v_d_mps = 5e-4
        self.slide_mps: float | None = None  # None: as the drive
        self.drive_scale = 1.0  # of its encoder
        self.gain = 1.0
        self.always_on = False  # the enable line is dead
        self.noise = {"drive_position_m": 1e-8, "mass_position_m": 1e-8}
        self.frozen: set[str] = set()
        self.nan: set[str] = set()
        self.sequence = 0
        self.t = 0
        self._rng = np.random.default_rng(1)
        self._position_m = self._slide_m = 0.0

    def command(self, frequency_Hz: float = 2600.0, amplitude_m: float = 30 * NANO, **other: Any) -> bool:
        """Whether a command is accepted that answers the newest block."""
        record = COMMAND.blank()
        record["run"], record["sequence"], record["block"] = RUN, self.sequence, int(self.s.block) - 1
        record["frequency_Hz"], record["amplitude_m"] = frequency_Hz, amplitude_m
        for name, value in other.items():
            record[name] = value
        self.sequence += 1
        return bool(accept(self.p, self.s, record[0]))

    def block(self, command_block: int, frequency_Hz: float = 2600.0, amplitude_m: float = 30 * NANO) -> None:
        """One block under a command in force."""
        allow(self.p, self.s, command_block, frequency_Hz, amplitude_m)
        record = sensor_block(20).blank()
        row: Any = record[0]
        t_s = (self.t * 20 + np.arange(1, 21)) * SAMPLE_S
        omega = 2.0 * math.pi * float(self.s.frequency_Hz)
        on = self.s.enable == 1 or self.always_on
        slide_mps = self.v_d_mps if self.slide_mps is None else self.slide_mps
        base_mps2 = -self.gain * on * float(self.s.amplitude_m) * omega**2 * np.sin(omega * t_s)
        for name, values in (
            ("drive_force_N", np.full(20, 14.0)),
            ("mass_accel_mps2", np.zeros(20)),
            ("base_accel_mps2", base_mps2),
            ("mass_position_m", self._slide_m + slide_mps * np.arange(1, 21) * SAMPLE_S),
            ("drive_position_m", self.drive_scale * (self._position_m + self.v_d_mps * np.arange(1, 21) * SAMPLE_S)),
        ):
            noise = 0.0 if name in self.frozen else self.noise.get(name, 1e-3)
            row[name][:] = 0.0 if name in self.frozen else values + noise * self._rng.standard_normal(20)
            if name in self.nan:
                row[name][3] = math.nan
        self._position_m += self.v_d_mps * 1e-3
        self._slide_m += slide_mps * 1e-3
        look(self.p, self.s, row)
        self.row = row
        self.t += 1

    def run(self, blocks: int, frequency_Hz: float = 2600.0, amplitude_m: float = 30 * NANO) -> None:
        """Blocks under fresh commands that stay the same."""
        for _ in range(blocks):
            self.block(max(int(self.s.block) - 1, 0), frequency_Hz, amplitude_m)
