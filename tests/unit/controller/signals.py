"""Made signals of a slide and its drive, and the controller's estimates from them."""

from typing import Any

import numpy as np

from bridge.config import validate
from bridge.kernel import kernel
from bridge.wire.messages import BLOCK, COMMAND, TRACE, sensor_block
from controller.config import ControllerConfig
from controller.core import step
from controller.records import build

SAMPLES = 20  # a block of 1 ms
SAMPLE_S = 5e-5
STIFFNESS_N_PER_M = 11700.0
FORCE_NOISE_N, POSITION_NOISE_M = 0.02, 5e-7  # rms of the white noise of the paper's rig


def time_s(seconds: float) -> Any:
    """The times of the samples [s]."""
    return SAMPLE_S * (1.0 + np.arange(round(seconds / SAMPLE_S)))


def listen(
    drive_m: Any,
    slide_m: Any,
    offset_N: Any = 0.0,
    seed: int = 1,
    position_noise_m: float = POSITION_NOISE_M,
    missing: str = "",
    **config: Any,
) -> Any:
    """The trace of a controller that only listens, of [blocks].

    Args:
        drive_m, slide_m: positions, [samples]; the force follows from them and `offset_N`.
        seed: of the noise.
        position_noise_m: rms of both positions.
        missing: a channel that is NaN.
        config: tables of the controller file besides.

    """
    chance = np.random.default_rng(seed)
    tables = {"policy": {"enabled_from_s": 1000.0}, **config}
    params, state = build(validate(ControllerConfig, tables, "test"))
    blocks = len(drive_m) // SAMPLES
    sensors = sensor_block(SAMPLES).blank(blocks)
    sensors["sequence"], sensors["t_ns"] = np.arange(blocks), 1_000_000 * np.arange(1, blocks + 1)
    force_N = offset_N + STIFFNESS_N_PER_M * (drive_m - slide_m)
    channels = {
        "drive_force_N": force_N + chance.normal(0.0, FORCE_NOISE_N, len(force_N)),
        "drive_position_m": drive_m + chance.normal(0.0, position_noise_m, len(drive_m)),
        "mass_position_m": slide_m + chance.normal(0.0, position_noise_m, len(slide_m)),
    }
    for name, values in channels.items():
        sensors[name] = values.reshape(blocks, SAMPLES) if name != missing else np.nan
    traces = TRACE.blank(blocks)
    _steps(params, state, sensors, COMMAND.blank(), traces)
    return traces


@kernel
def _steps(params: Any, state: Any, sensors: Any, command: Any, traces: Any) -> None:
    for i in range(sensors.shape[0]):
        step(params, state, sensors[i : i + 1], BLOCK, 0, sensors[i].t_ns, command, traces[i : i + 1])


def stick_slip(seconds: float, velocity_mps: float, stick_s: float, slip_s: float) -> tuple[Any, Any]:
    """Positions [m], [samples], of a drive and of a slide that sticks for `stick_s` and catches up in `slip_s`."""
    t_s = time_s(seconds)
    period_s = stick_s + slip_s
    slipping_s = np.clip(t_s % period_s - stick_s, 0.0, None)
    way_m = velocity_mps * period_s
    slide_m = way_m * (np.floor(t_s / period_s) + 0.5 * (1.0 - np.cos(np.pi * slipping_s / slip_s)))
    return velocity_mps * t_s, slide_m
