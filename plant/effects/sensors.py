"""Faults of the sensors: gain, zero, lag and delay of the force; gain of the accelerations."""

import math
from typing import Any, Final

from bridge.kernel import kernel
from bridge.layouts import PlantMemory, PlantParams
from plant.effects.row import Effect, Formula, Parameter, one_form, ratio

LONGEST_DELAY: Final = 254  # longest delay of the force [samples]; 12.7 ms at 20 kHz
LAG_ORDERS: Final = {"first-order": 1, "second-order": 2, "fourth-order": 4}  # low-passes of a slow force sensor
_DELAY_LINE = LONGEST_DELAY + 2  # the delayed sample, the previous and the present sample


@kernel
def force_reading_N(p: PlantParams, s: PlantMemory, force_N: float, t_s: float) -> float:
    """The signal of the force sensor with its faults; call it once per sample."""
    if p.force_lag_s > 0.0:
        share = 1.0 - math.exp(-p.dt_s * p.steps_per_sample / p.force_lag_s)
        for i in range(int(p.force_lag_order)):
            s.force_lag[i] += share * (force_N - s.force_lag[i])
            force_N = s.force_lag[i]
    if p.force_delay_s > 0.0:
        s.delay_line[s.delay_at] = force_N
        back = p.force_delay_s / (p.dt_s * p.steps_per_sample)
        cells = math.floor(back)
        newer = s.delay_line[(s.delay_at - int(cells)) % _DELAY_LINE]
        older = s.delay_line[(s.delay_at - int(cells) - 1) % _DELAY_LINE]
        force_N = newer + (back - cells) * (older - newer)
        s.delay_at = (s.delay_at + 1) % _DELAY_LINE
    offset_N = p.force_bias_N + p.force_rate_N_per_s * t_s
    if p.force_settling_s > 0.0:
        offset_N += p.force_drift_N * (1.0 - math.exp(-t_s / p.force_settling_s))
    return force_N * (1.0 + p.force_ratio) + offset_N / p.force_gain  # `plant.sensors` multiplies the sum by the gain


def _set_lag(p: Any, form: str, _value: dict[str, float]) -> None:
    p.force_lag_order = LAG_ORDERS[form]


def _set_accelerometer(p: Any, form: str, value: dict[str, float]) -> None:
    p.mass_accel_ratio = 0.0 if form == "base" else value["ratio"]
    p.base_accel_ratio = 0.0 if form == "mass" else value["ratio"]


SENSORS: Final = {
    "force-sensor-gain": Effect("sensor", one_form("reading times 1 + ratio", ratio(0.05)), prefix="force_"),
    "force-sensor-bias": Effect(
        "sensor", one_form("reading plus bias_N", Parameter("bias_N", -1e5, 1e5, 0.5)), prefix="force_"
    ),
    "force-sensor-drift": Effect(
        "sensor",
        {
            "linear": Formula("reading plus rate t", (Parameter("rate_N_per_s", -1e3, 1e3, 0.05),)),
            "settling": Formula(
                "reading plus drift_N (1 - exp(-t / settling_s))",
                (Parameter("drift_N", -1e5, 1e5, 0.5), Parameter("settling_s", 0.1, 1e4, 5.0)),
            ),
        },
        prefix="force_",
    ),
    "force-sensor-lag": Effect(
        "sensor",
        {
            "first-order": Formula("reading through a first-order low-pass", (Parameter("lag_s", 0.0, 1.0, 1e-3),)),
            "second-order": Formula("reading through two equal low-passes", (Parameter("lag_s", 0.0, 1.0, 5e-4),)),
            "fourth-order": Formula("reading through four equal low-passes", (Parameter("lag_s", 0.0, 1.0, 2.5e-4),)),
        },
        _set_lag,
        prefix="force_",
        numbers=("force_lag_order",),
        memory=(("force_lag", "f8", (max(LAG_ORDERS.values()),)),),
    ),
    "force-sensor-delay": Effect(
        "sensor",
        one_form("reading is delayed by delay_s", Parameter("delay_s", 0.0, 0.012, 1e-3)),
        prefix="force_",
        memory=(("delay_line", "f8", (_DELAY_LINE,)), ("delay_at", "i8")),
    ),
    "accelerometer-gain": Effect(
        "sensor",
        {
            "both": Formula("both accelerations times 1 + ratio", (ratio(0.05),)),
            "mass": Formula("acceleration of the mass times 1 + ratio", (ratio(0.05),)),
            "base": Formula("acceleration of the base times 1 + ratio", (ratio(0.05),)),
        },
        _set_accelerometer,
        numbers=("mass_accel_ratio", "base_accel_ratio"),
        switches=("mass_accel_ratio", "base_accel_ratio"),
    ),
}
