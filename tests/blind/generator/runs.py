"""The protocol: the commands of drive and piezo in each run, and their motion."""

from dataclasses import dataclass, field

import numpy as np

from tests.blind.generator.kernel import SAMPLE_RATE_HZ

AMPLITUDE_m = 0.02e-6
DRIVE_RAMP_S = 0.050
VIBRATION_RAMP_S = 0.025  # a step of a piezo rings its mount; 20 to 100 ms is usual


@dataclass(frozen=True)
class Plan:
    """One run: pairs of (start [s], drive velocity [m/s]) and of (start [s], vibration frequency [Hz]; 0 is off)."""

    drive: tuple[tuple[float, float], ...]
    vibration: tuple[tuple[float, float], ...] = ()
    holdout: bool = False
    duration_s: float = 10.0

    @property
    def constant_velocity_mps(self) -> float | None:
        return self.drive[0][1] if len(self.drive) == 1 else None


PROTOCOL = (
    Plan(drive=((0.0, 0.5e-3),)),
    Plan(drive=((0.0, 2e-3), (1.5, -2e-3), (4.0, -0.15e-3))),
    Plan(drive=((0.0, 0.5e-3),), vibration=((2.0, 3000.0), (4.0, 1000.0), (6.0, 4500.0), (8.0, 2000.0))),
    Plan(
        drive=((0.0, 0.7e-3), (5.0, -2e-3), (7.2, -0.2e-3)),
        vibration=((2.5, 2500.0), (5.0, 0.0)),
        holdout=True,
    ),
)


@dataclass
class Tracks:
    """The inputs of the rig during one run. Knots have samples + 1 values, held values have `samples`."""

    number: int  # of the run, from 0
    t_s: np.ndarray  # knots
    origin_m: float  # start of the drive on the track
    drive_m: np.ndarray  # knots; travel of the drive from `origin_m`
    drive_mps: np.ndarray  # knots
    unseen_m: np.ndarray  # knots; motion of the spring's end that the measured drive position does not show
    load: np.ndarray  # knots; factor on friction
    frequency_Hz: np.ndarray  # held
    amplitude_m: np.ndarray  # knots; delivered
    phase_rad: np.ndarray  # held; phase of the delivered vibration against the commanded one
    commanded_m: np.ndarray = field(init=False)

    def __post_init__(self) -> None:
        self.commanded_m = self.amplitude_m.copy()


def _vibration(plan: Plan, t_s: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Frequency and amplitude at t; the amplitude ramps from zero after a frequency begins, and to zero before it ends."""
    frequency, amplitude = np.zeros_like(t_s), np.zeros_like(t_s)
    ends = [begin for begin, _ in plan.vibration[1:]] + [plan.duration_s + 1.0]
    for (begin, value), end in zip(plan.vibration, ends, strict=False):
        inside = (t_s >= begin) & (t_s < end)
        frequency[inside] = value
        ramp = np.minimum(t_s - begin, end - t_s)[inside] / VIBRATION_RAMP_S
        amplitude[inside] = AMPLITUDE_m * np.clip(ramp, 0.0, 1.0) * (value > 0.0)
    return frequency, amplitude


def tracks_of(plan: Plan, number: int, origin_m: float = 0.0) -> Tracks:
    """The inputs as planned: drive and piezo follow their commands exactly, and the load is constant."""
    samples = round(plan.duration_s * SAMPLE_RATE_HZ)
    t_s = np.arange(samples + 1) / SAMPLE_RATE_HZ
    knots, speeds, before = [], [], 0.0
    for begin, speed in plan.drive:
        knots += [begin, begin + DRIVE_RAMP_S]
        speeds += [before, speed]
        before = speed
    drive_mps = np.interp(t_s, knots, speeds)
    # the ramps begin and end on samples, so trapezoids add up to the exact position
    drive_m = np.concatenate(([0.0], np.cumsum(0.5 * (drive_mps[1:] + drive_mps[:-1])) / SAMPLE_RATE_HZ))
    frequency, amplitude = _vibration(plan, t_s)
    return Tracks(
        number=number,
        t_s=t_s,
        origin_m=origin_m,
        drive_m=drive_m,
        drive_mps=drive_mps,
        unseen_m=np.zeros_like(t_s),
        load=np.ones_like(t_s),
        frequency_Hz=frequency[:-1],
        amplitude_m=amplitude,
        phase_rad=np.zeros(samples),
    )
