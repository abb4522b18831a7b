"""Checks before a run that its sensors have the range, noise, resolution and bandwidth to show the described motion.

So no verdict rests on a sensor that cannot show the motion. A refusal recommends a value with a margin: a range of 1.25 times the
largest force or travel or twice the largest acceleration, twice the bandwidth limit, half of the noise limit, a quarter of the
resolution limit. Faults (`[[fault]]`) do not belong to the description. Figures below: docs/method/sensors.md.
"""

import math
from typing import Any, NamedTuple, NoReturn

import numpy as np

from controller.config import ControllerConfig, candidate_frequencies_Hz, cheapest_frequency_Hz
from plant.config import RigConfig, SensorsConfig
from plant.drive_motion import DriveMotion, lowest_mps, reach_m
from plant.records import build

# Recommended range over the largest force or travel. Smaller: noise and overshoot reach its end. Larger: coarser sensors.
_MARGIN = 1.25
# Least size of a slip in rms noises of a sample, for force and positions. Larger: a force sensor with 9 is refused, which shows
# each slip. Smaller: with 4.5 the controller doubts the force, with 2.2 the judge counts no slip.
_NOISES_A_SLIP = 5.0
# Least acceleration of the base in rms noises of a sample. Larger: an accelerometer with 44 is refused, with which the controller
# holds v_a. Smaller: with 22 the controller goes to open loop, and the axis slips.
_NOISES_AN_AMPLITUDE = 32.0
# Least size of a slip, or acceleration of the base, in steps of the resolution. Larger: 99 is refused, which shows each slip.
# Smaller: with 81 a channel counts as frozen, clipped or of a wrong scale. Steps up to twice the rms noise are always allowed, as
# the noise hides them, even where a slip is as small as a step.
_STEPS, _HIDDEN = 96.0, 2.0
# A position's noise may be a fifth of a slip, or of the drive's travel in this time if that is longer. Larger: noise of 10 um
# passes on a ball screw, and hides slips. Smaller: a feed of 0.02 mm/s without slips is refused, which the controller follows.
_TRAVEL_S = 0.125
# Least bandwidth of force and position sensors over the natural frequency of the slide on its spring; slower ones lag in a slip,
# and contradict each other. Larger: 2 is refused, which changes no verdict on 16 drawn axes. Smaller: 1.4 changes five.
_LEAST_BAND = 2.0


def refuse_out_of_travel(rig: RigConfig, duration_s: float) -> None:
    """Raise ValueError for a drive that leaves the range of the position sensors within the run; a duration of 0 has no end."""
    sensors, motion = rig.sensors, rig.drive.motion()
    if motion.drift_m != 0.0 and not duration_s:
        raise ValueError(
            f"rig.drive.repeat_every_s = {rig.drive.repeat_every_s:g}: each cycle ends {motion.drift_m * 1e3:.3g} mm from its "
            "start: must be 0 mm in a run without an end; change the way back, or give duration_s"
        )
    low_m, high_m, until_s = sensors.position_lowest_m, sensors.position_range_m, _until_s(rig, motion, duration_s)

    def leaves(at_s: float) -> bool:
        lowest_m, highest_m = reach_m(motion, at_s)
        return lowest_m < low_m or highest_m > high_m

    if not leaves(until_s):
        return
    inside_s, leaves_s = 0.0, until_s
    while leaves_s - inside_s > max(1e-4 * leaves_s, 1e-6):
        middle_s = 0.5 * (inside_s + leaves_s)
        inside_s, leaves_s = (inside_s, middle_s) if leaves(middle_s) else (middle_s, leaves_s)
    is_beyond = reach_m(motion, leaves_s)[1] > high_m
    end_m, (lowest_m, highest_m) = high_m if is_beyond else low_m, reach_m(motion, until_s)
    ends = f"this sensor ends at {end_m * 1e3:g} mm, where the drive is after {leaves_s:.4g} s"
    if not duration_s:
        raise ValueError(
            f"duration_s = 0: {ends}: must turn before; change the way back, or set it to {_below(leaves_s):g}"
        )
    reached_m = highest_m if is_beyond else lowest_m
    why = f"the drive goes to {reached_m * 1e3:.6g} mm within duration_s = {duration_s:g}, {ends}"
    name, rounded = ("range", _above) if is_beyond else ("lowest", _below)
    _refuse(f"sensors.position_{name}_m", end_m, why, f"{rounded(_MARGIN * reached_m):g}, or shorten the run")


def _until_s(rig: RigConfig, motion: DriveMotion, duration_s: float) -> float:
    """End of the checked motion: of the run if it has one, else of one cycle, else when the last velocity leaves every range."""
    if duration_s or math.isfinite(motion.period_s):
        return duration_s or motion.period_s
    last_mps, span_m = abs(float(motion.velocity_mps[-1])), rig.sensors.position_range_m - rig.sensors.position_lowest_m
    more_s = 2.0 * (span_m + float(np.ptp(motion.position_m))) / last_mps if last_mps > 0.0 else 0.0
    return float(motion.start_s[-1]) + more_s


class _Needs(NamedTuple):
    """Sizes of the described motion that the sensors must show, along the drive."""

    most_N: float  # largest drive force forwards, as the sensor shows it
    least_N: float  # largest drive force backwards; 0 if the drive does not go back and the slide does not overshoot
    fall_N: float  # fall of the force in a slip, 2 (F_s - F_c), as the sensor shows it; 0 if no slip is expected
    slip_m: float  # length of a slip, 2 (F_s - F_c) / k_d; 0 if no slip is expected
    slip_mps2: float  # acceleration of a slip; 0 if no slip is expected
    natural_Hz: float  # frequency of the slide on its spring


def refuse_blind_sensors(rig: RigConfig, controller: ControllerConfig, duration_s: float) -> None:
    """Raise ValueError for a sensor that cannot show the motion that the description implies, with the number to use."""
    needs = _needs(rig, duration_s)
    _force(rig, needs)  # checked even if the controller does not use it: the verdict counts slips in it
    if speeds_mps := rig.drive.speeds_mps():
        _positions(rig.sensors, needs.slip_m, _TRAVEL_S * speeds_mps[0], needs.natural_Hz)
        _base(rig, controller, needs.slip_mps2, speeds_mps[0], speeds_mps[-1])


def _needs(rig: RigConfig, duration_s: float) -> _Needs:
    p: Any = build(rig)[0][0]
    motion = rig.drive.motion()
    until_s = _until_s(rig, motion, duration_s)
    lowest_m, highest_m = reach_m(motion, until_s)
    speeds_mps = rig.drive.speeds_mps() or [0.0]
    k_d, mass_kg, fastest_mps = float(p.k_d), float(p.m), speeds_mps[-1]
    impedance_Ns_per_m = math.sqrt(k_d * mass_kg)
    drift = max(float(p.drift_rate_per_s) * until_s, float(p.drift_ratio) if p.drift_settling_s > 0.0 else 0.0, 0.0)
    ratios = drift, max(p.forward_ratio, p.backward_ratio, 0.0), p.position_ratio, p.load_ratio, p.roughness_ratio
    level = math.prod(1.0 + abs(float(ratio)) for ratio in ratios)
    # force to accelerate the slide; the spring limits it to the force for a step of the drive velocity
    begins_N = min(mass_kg * float(np.abs(motion.acceleration_mps2).max()), impedance_Ns_per_m * fastest_mps)
    viscous_N = (float(p.h_v) + float(p.quadratic_Ns2_per_m2) * fastest_mps) * fastest_mps
    static_N, coulomb_N = level * float(p.F_s), level * float(p.F_c)
    # The drive winds the spring up from its first velocity at the largest acceleration. At break-away it goes at this velocity;
    # the slide then swings about the force that moves it. A step to the fastest velocity swings most.
    winds_up_mps = math.hypot(float(motion.velocity_mps[0]), math.sqrt(2.0 * begins_N / mass_kg * static_N / k_d))
    swing_N = min(
        begins_N + math.hypot(static_N - coulomb_N - begins_N, impedance_Ns_per_m * min(winds_up_mps, fastest_mps)),
        math.hypot(static_N - coulomb_N, impedance_Ns_per_m * fastest_mps),
    )
    friction_N = max(static_N, coulomb_N + max(swing_N, viscous_N + begins_N))
    # the travel of the drive limits the force, as the spring begins unloaded
    stiffest_N_per_m = k_d * (1.0 + max(float(p.knee_ratio), 0.0)) + float(p.h_d) * fastest_mps
    gain, bias_N = rig.sensors.force_gain * (1.0 + float(p.force_ratio)), float(p.force_bias_N)
    back_N = min(friction_N, stiffest_N_per_m * (highest_m - lowest_m)) if lowest_mps(motion, until_s) < 0.0 else 0.0
    # a slide slips if it becomes faster than its drive by more than half of v_d
    drop_N = float(p.F_s) - float(p.F_c)
    drop_N = drop_N if drop_N / impedance_Ns_per_m > 0.5 * speeds_mps[0] > 0.0 else 0.0
    # without damping a slip ends as far below F_c as it began above it: the drive pushes if F_s exceeds 2 F_c
    back_N = max(back_N, float(p.F_s) - 2.0 * float(p.F_c) if drop_N > 0.0 else 0.0)
    return _Needs(
        most_N=gain * min(friction_N, stiffest_N_per_m * highest_m) + max(bias_N, 0.0),
        least_N=gain * back_N - min(bias_N, 0.0) if back_N > 0.0 else 0.0,
        fall_N=2.0 * gain * drop_N,
        slip_m=2.0 * drop_N / k_d,
        slip_mps2=drop_N / mass_kg,
        natural_Hz=math.sqrt(k_d / mass_kg) / (2.0 * math.pi),
    )


def _refuse(name: str, value: float, why: str, remedy: str) -> NoReturn:
    raise ValueError(f"rig.{name} = {value:g}: {why}; set it to {remedy}")


def _force(rig: RigConfig, needs: _Needs) -> None:
    sensors, lowest_N, highest_N = rig.sensors, rig.sensors.force_lowest_N, rig.sensors.force_range_N
    if needs.most_N > highest_N:
        why = f"the drive pulls with {needs.most_N:.4g} N, this sensor ends at {highest_N:g} N"
        _refuse("sensors.force_range_N", highest_N, why, f"{_above(_MARGIN * needs.most_N):g}")
    if needs.least_N > -lowest_N:
        why = f"the drive pushes with {needs.least_N:.4g} N as it goes back or after a slip, this sensor ends at {lowest_N:g} N"
        _refuse("sensors.force_lowest_N", lowest_N, why, f"{-max(_above(_MARGIN * needs.least_N), highest_N):g}")
    if needs.fall_N == 0.0:
        return
    fall = f"the force falls by {needs.fall_N:.3g} N in a slip"
    _resolves(sensors, "force", "N", needs.fall_N / _NOISES_A_SLIP, needs.fall_N, fall)
    _band(sensors, "force_bandwidth_Hz", needs.natural_Hz)
    most_s = 1.0 / (2.0 * math.pi * needs.natural_Hz)
    if (lag_s := float(rig.effects.get("force-sensor-lag", {}).get("lag_s", 0.0))) > most_s:
        why = f"the slide slips at {needs.natural_Hz:.3g} Hz, and this sensor lags too much to show it"
        _refuse("effects.force-sensor-lag.lag_s", lag_s, why, f"{_below(0.5 * most_s):g}")


def _resolves(sensors: SensorsConfig, channel: str, unit: str, most_noise: float, size: float, signal: str) -> None:
    """Refuse a channel whose noise exceeds `most_noise`, or whose resolution is too coarse for a signal of `size`."""
    noise, step = (getattr(sensors, f"{channel}_{quantity}_{unit}") for quantity in ("noise", "resolution"))
    for quantity, value, most, harm, share in (
        ("noise", noise, most_noise, "noise above {} hides it", 0.5),
        ("resolution", step, max(size / _STEPS, _HIDDEN * noise), "steps above {} distort it", 0.25),
    ):
        if value > most:
            limit = f"{most:.3g} {unit.replace('mps2', 'm/s2')}"
            why = f"{signal}; {harm.format(limit)}"
            _refuse(f"sensors.{channel}_{quantity}_{unit}", value, why, f"{_below(share * most):g}")


def _band(sensors: SensorsConfig, name: str, natural_Hz: float) -> None:
    if (value := getattr(sensors, name)) < (least_Hz := _LEAST_BAND * natural_Hz):
        why = f"the slide slips at {natural_Hz:.3g} Hz, which this sensor does not follow"
        _refuse(f"sensors.{name}", value, why, f"{_above(2.0 * least_Hz):g}")


def _positions(sensors: SensorsConfig, slip_m: float, way_m: float, natural_Hz: float) -> None:
    slip = f"a slip is {slip_m:.3g} m long, " if slip_m else ""
    ways = f"{slip}the drive goes {way_m:.3g} m in {_TRAVEL_S:g} s"
    _resolves(sensors, "position", "m", max(slip_m, way_m) / _NOISES_A_SLIP, slip_m or way_m, ways)
    if slip_m > 0.0:
        _band(sensors, "position_bandwidth_Hz", natural_Hz)


def _base(
    rig: RigConfig, controller: ControllerConfig, slip_mps2: float, slowest_mps: float, fastest_mps: float
) -> None:
    """Check range, bandwidth, noise and resolution of the accelerometers at the frequency that the controller would choose."""
    sensors, limits = rig.sensors, controller.limits
    frequency_Hz, lowest_Hz = cheapest_frequency_Hz(controller), candidate_frequencies_Hz(controller)[0]
    omega = math.tau * frequency_Hz

    def accel_mps2(v_d_mps: float) -> float:
        """Acceleration of the base at this feed."""
        reached_mps = omega * min(limits.amplitude_max_m, rig.piezo.amplitude_max_m)
        return omega * min(limits.v_ratio * v_d_mps, limits.velocity_max_mps, reached_mps)

    base_mps2 = accel_mps2(fastest_mps)
    if (most_mps2 := max(base_mps2, slip_mps2)) > sensors.accel_range_mps2:
        why = f"base and slide accelerate with {most_mps2:.3g} m/s2, this sensor ends at {sensors.accel_range_mps2:g} m/s2"
        _refuse("sensors.accel_range_mps2", sensors.accel_range_mps2, why, f"{_above(2.0 * most_mps2):g}")
    band_Hz = sensors.accel_bandwidth_Hz
    if band_Hz < frequency_Hz and band_Hz != controller.amplitude.accel_bandwidth_Hz:
        why = f"the base vibrates at {frequency_Hz:g} Hz, where this sensor shows too little"
        known = f"or, for a sensor of {band_Hz:g} Hz, set controller.amplitude.accel_bandwidth_Hz = {band_Hz:g}"
        remedy = f"{_above(2.0 * frequency_Hz):g}, {known}: the controller then corrects v_a"
        _refuse("sensors.accel_bandwidth_Hz", band_Hz, why, remedy)
    if sensors.accel_lowest_Hz > 0.5 * lowest_Hz:
        why = f"the base vibrates from {lowest_Hz:g} Hz on"
        _refuse("sensors.accel_lowest_Hz", sensors.accel_lowest_Hz, why, f"{_below(0.1 * lowest_Hz):g}")
    least_mps2 = accel_mps2(slowest_mps)
    least = f"the base vibrates with {least_mps2:.3g} m/s2 at {slowest_mps * 1e3:.3g} mm/s"
    _resolves(sensors, "accel", "mps2", least_mps2 / _NOISES_AN_AMPLITUDE, least_mps2, least)


def _above(value: float) -> float:
    """The next number of two digits at or above a value."""
    digit = 10.0 ** (math.floor(math.log10(abs(value))) - 1)
    return float(f"{math.ceil(value / digit - 1e-9) * digit:.6g}")


def _below(value: float) -> float:
    """The next number of two digits at or below a value."""
    return -_above(-value)
