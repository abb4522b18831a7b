"""The sensors of a scenario against its description: range, resolution, noise, rate and band that the motion needs.

Before a run, so that no verdict rests on a sensor that cannot show the motion. Only sensors that surely cannot are refused: each
limit below has the value that the shipped rigs and 180 drawn axes keep to. Faults (`[[fault]]`) are no part of the description.
"""

import math
from typing import Any, NamedTuple, NoReturn

import numpy as np

from controller.config import ControllerConfig, candidate_frequencies_Hz
from plant.config import RigConfig
from plant.drive_motion import Motion, lowest_mps, reach_m
from plant.records import build

# A refusal has no margin; the number to use is this many times the largest value that is sure to come. Larger: coarser sensors
# are advised; smaller: an effect that is not described leaves the range.
_ROOM = 1.25
# A fall of the force counts as a slip from ten standard deviations of its means over 1 ms on (`diagnosis.features.cycles`, whose
# values these are). Shipped: 258 and more, but for the bank's family `blind`, 1.3 to 4.5, in which nothing sees a slip.
_SIGMAS, _BIN_S = 10.0, 1e-3
# Steps of the force's resolution in F_s - F_c, half of a fall. Larger: coarse sensors that show each slip are refused; smaller: a
# fall of a step or two, which noise makes too, counts. Shipped: 940 and more.
_STEPS_A_DROP = 4.0
# Steps of the position's resolution in the way of a slip, 2 (F_s - F_c) / k_d. Larger: stiff axes are refused whose force shows
# every slip; smaller: a slip may change no sample. Shipped: 2.3 and more, drawn: 1.3.
_STEPS_A_SLIP = 1.0
# Noise of the position's means over 1 ms in the same way. Larger: stiff axes are refused, as above; smaller: noise outruns slips.
# Shipped: 3.9 and more.
_SIGMAS_A_SLIP = 2.0
# In which the drive's velocity has to stand out from noise: the controller has it to settle. Larger: feeds pass that it cannot
# follow in time; smaller: slow feeds are refused that it follows. Shipped: 0.03 s.
_LONGEST_S = 1.0
# Samples in a period of the slide on its spring. Larger: stiff axes are refused; smaller: ends of slips are cut. Shipped: 60.
_FEWEST_SAMPLES = 8.0
# Least steps of the accelerometer's resolution in the amplitude of the slowest feed, and least amplitude over its noise. Larger:
# slow feeds are refused; smaller: v_a is off by more than 10 % in the 5 ms of its filter. Shipped: 110 steps, 70 times the noise.
_STEPS_AN_AMPLITUDE, _LEAST_OVER_NOISE = 4.0, 2.0
# The accelerometer's bandwidth over the one that the controller corrects for, either way. Larger: v_a is off by as much; smaller:
# a bandwidth that was rounded is refused.
_SAME_BAND = 1.1
_MOST_OF_NOISE = 2.0  # of smooth noise over its rms: its largest value, sqrt(3) / sqrt(26/35), not tuned
_LAGS = {"second-order": 2.0, "fourth-order": 4.0}  # of a force sensor in a row, by the form of its effect


def refuse_out_of_travel(rig: RigConfig, duration_s: float) -> None:
    """Raise ValueError for a drive that leaves the range of the position sensors within the run; a duration of 0 has no end."""
    sensors, motion = rig.sensors, rig.drive.motion()
    if motion.drift_m != 0.0 and not duration_s:
        raise ValueError(
            f"rig.drive.repeat_every_s = {rig.drive.repeat_every_s:g}: each cycle ends {motion.drift_m * 1e3:.3g} mm from where "
            "it began, and a run without an end leaves every range: must end where it began; change the way back, or give "
            "duration_s"
        )
    until_s = _until_s(rig, motion, duration_s)
    lowest_m, highest_m = reach_m(motion, until_s)
    low_m, high_m = sensors.position_lowest_m, sensors.position_range_m
    if low_m <= lowest_m and highest_m <= high_m:
        return
    leaves_s = _leaves_s(motion, until_s, low_m, high_m)
    beyond = reach_m(motion, leaves_s)[1] > high_m
    if not duration_s:
        end_m = high_m if beyond else low_m
        raise ValueError(
            f"duration_s = 0: the drive goes on without an end, and leaves the transducers' {end_m * 1e3:g} mm after "
            f"{leaves_s:.4g} s: must turn before; give it a way back, or an end, duration_s = {_below(leaves_s):g} at most"
        )
    if beyond:
        raise ValueError(
            f"duration_s = {duration_s:g}: the drive would travel to {highest_m * 1e3:.1f} mm, beyond the transducers' "
            f"{high_m * 1e3:g} mm, where it is after {leaves_s:.4g} s; shorten the run, slow the drive or raise "
            f"rig.sensors.position_range_m to {_above(_ROOM * highest_m):g}"
        )
    raise ValueError(
        f"duration_s = {duration_s:g}: the drive would travel to {lowest_m * 1e3:.4g} mm, below the transducers' "
        f"{low_m * 1e3:g} mm; shorten the run, let the drive go forward first or lower rig.sensors.position_lowest_m to "
        f"{lowest_m:.3g}"
    )


def _until_s(rig: RigConfig, motion: Motion, duration_s: float) -> float:
    """To when the motion is looked at: of a run without an end one cycle, or until its last velocity has left every range."""
    if duration_s:
        return duration_s
    if math.isfinite(motion.period_s):
        return motion.period_s
    last_mps, span_m = abs(float(motion.velocity_mps[-1])), rig.sensors.position_range_m - rig.sensors.position_lowest_m
    more_s = 2.0 * (span_m + float(np.ptp(motion.position_m))) / last_mps if last_mps > 0.0 else 0.0
    return float(motion.start_s[-1]) + more_s


def _leaves_s(motion: Motion, until_s: float, low_m: float, high_m: float) -> float:
    """When the drive first leaves the range [s], by halving."""
    inside_s, outside_s = 0.0, until_s
    while outside_s - inside_s > 1e-6 * until_s:
        middle_s = 0.5 * (inside_s + outside_s)
        lowest_m, highest_m = reach_m(motion, middle_s)
        if low_m <= lowest_m and highest_m <= high_m:
            inside_s = middle_s
        else:
            outside_s = middle_s
    return outside_s


class _Needs(NamedTuple):
    """What the description implies for the sensors, along the drive."""

    most_N: float  # of the drive force, forwards, as the sensor shows it
    least_N: float  # backwards; 0 where the drive does not go back
    drop_N: float  # F_s - F_c, as the sensor shows it; 0 where no slip is to be expected
    stiffness_N_per_m: float
    slip_m: float  # way of a slip, 2 (F_s - F_c) / k_d
    stick_s: float  # at the fastest feed
    natural_Hz: float  # of the slide on its spring
    slowest_mps: float
    fastest_mps: float


def refuse_blind_sensors(rig: RigConfig, controller: ControllerConfig, duration_s: float) -> None:
    """Raise ValueError for a sensor that cannot show the motion that the description implies, with the number to use."""
    needs = _needs(rig, duration_s)
    if controller.estimator.use_force:
        _force(rig, needs)
    if needs.fastest_mps > 0.0:
        _positions(rig, controller, needs)
        _base(rig, controller, needs)


def _needs(rig: RigConfig, duration_s: float) -> _Needs:
    p: Any = build(rig)[0][0]
    motion = rig.drive.motion()
    until_s = _until_s(rig, motion, duration_s)
    lowest_m, highest_m = reach_m(motion, until_s)
    speeds_mps = rig.drive.speeds_mps() or [0.0]
    k_d, mass_kg = float(p.k_d), float(p.m)
    fastest_mps = speeds_mps[-1]
    level = _largest_level(p, until_s)
    static_N = level * (float(p.F_s) + max(_aged_N(p), 0.0))
    rooted = math.sqrt(k_d * mass_kg)
    # the spring gives way to a fast start: at most the force of a step of the velocity
    begins_N = min(mass_kg * float(np.abs(motion.acceleration_mps2).max()), rooted * fastest_mps)
    slides_N = (
        level * float(p.F_c) + (float(p.h_v) + float(p.quadratic_Ns2_per_m2) * fastest_mps) * fastest_mps + begins_N
    )
    # no more than the spring can be wound up by the way of the drive, which begins without a force
    stiffest_N_per_m = k_d * (1.0 + max(float(p.knee_ratio), 0.0)) + float(p.h_d) * fastest_mps
    most_N = min(max(static_N, slides_N), stiffest_N_per_m * highest_m)
    goes_back = lowest_mps(motion, until_s) < 0.0
    least_N = min(max(static_N, slides_N), stiffest_N_per_m * (highest_m - lowest_m)) if goes_back else 0.0
    gain = rig.sensors.force_gain * (1.0 + float(p.force_ratio))
    drop_N = float(p.F_s) - float(p.F_c)
    # a slide that does not become half of v_d faster than its drive does not slip
    slips = drop_N / rooted > 0.5 * speeds_mps[0] > 0.0
    return _Needs(
        most_N=gain * most_N + max(float(p.force_bias_N), 0.0),
        least_N=gain * least_N - min(float(p.force_bias_N), 0.0) if goes_back else 0.0,
        drop_N=gain * drop_N if slips else 0.0,
        stiffness_N_per_m=gain * k_d,
        slip_m=2.0 * drop_N / k_d if slips else 0.0,
        stick_s=2.0 * drop_N / (k_d * fastest_mps) if slips else 0.0,
        natural_Hz=math.sqrt(k_d / mass_kg) / (2.0 * math.pi),
        slowest_mps=speeds_mps[0],
        fastest_mps=fastest_mps,
    )


def _aged_N(p: Any) -> float:
    """By how much the contact is stronger after a second at rest, the longest that is sure to come."""
    if p.age_growth_N == 0.0:
        return 0.0
    if p.age_exponent > 0.0:
        return float(p.age_growth_N - p.age_rested_N)
    grown = -math.expm1(-1.0 / p.age_settling_s) if p.age_settling_s > 0.0 else math.log1p(1.0 / p.age_scale_s)
    return float(p.age_growth_N * grown - p.age_rested_N)


def _largest_level(p: Any, until_s: float) -> float:
    """What effects multiply the friction by, at most, within the run."""
    drift = max(float(p.drift_per_s) * until_s, float(p.drift_ratio) if p.drift_settling_s > 0.0 else 0.0, 0.0)
    place = _MOST_OF_NOISE if p.position_seed >= 0.0 else 1.0
    load = _MOST_OF_NOISE if p.load_seed >= 0.0 else 1.0
    level = 1.0 + drift
    level *= 1.0 + abs(float(p.position_ratio)) * place
    level *= 1.0 + abs(float(p.load_ratio)) * load
    level *= 1.0 + float(p.roughness_ratio) * _MOST_OF_NOISE
    return level * (1.0 + max(float(p.forward_ratio), float(p.backward_ratio), 0.0))


def _refuse(name: str, value: float, why: str, remedy: str) -> NoReturn:
    raise ValueError(f"rig.{name} = {value:g}: {why}; set it to {remedy}")


def _force(rig: RigConfig, needs: _Needs) -> None:
    sensors, sample_s = rig.sensors, rig.solver.block_s / rig.solver.samples_per_block
    lowest_N, highest_N = sensors.force_lowest_N, sensors.force_range_N
    if needs.most_N > highest_N:
        friction = f"contact.static_force_N = {rig.contact.static_force_N:g}, effects and motion included"
        why = f"with {friction}, the drive pulls with {needs.most_N:.4g} N: must be more than that"
        _refuse("sensors.force_range_N", highest_N, why, f"{_above(_ROOM * needs.most_N):g}")
    if needs.least_N > -lowest_N:
        why = f"the drive goes back within the run, and pushes with {needs.least_N:.4g} N: must be below that"
        _refuse("sensors.force_lowest_N", lowest_N, why, f"{-max(_above(_ROOM * needs.least_N), highest_N):g}")
    if needs.drop_N == 0.0:
        return
    if sensors.force_resolution_N > needs.drop_N / _STEPS_A_DROP:
        why = f"friction falls by {needs.drop_N:.3g} N from rest to sliding, less than {_STEPS_A_DROP:g} steps of it"
        most = f"{_below(needs.drop_N / _STEPS_A_DROP):g} or less"
        _refuse("sensors.force_resolution_N", sensors.force_resolution_N, why, most)
    step_N = sensors.force_resolution_N / math.sqrt(12.0)
    # a mean over 1 ms has the noise of its samples over the root of their number; a slip falls by twice the drop
    by_fall_N = 2.0 * needs.drop_N / _SIGMAS * math.sqrt(max(_BIN_S / sample_s, 1.0))
    by_stick_N = needs.stiffness_N_per_m * _most_noise_m(needs.stick_s, needs.fastest_mps, sample_s)
    most_N = min(by_fall_N, by_stick_N)
    if math.hypot(sensors.force_noise_N, step_N) > most_N:
        fall = f"the force falls by {2.0 * needs.drop_N:.3g} N after {needs.stick_s:.2g} s of stick"
        most = f"{_below(math.sqrt(max(most_N**2 - step_N**2, 0.0))):g} or less"
        _refuse(
            "sensors.force_noise_N", sensors.force_noise_N, f"a slip, in which {fall}, does not stand out from it", most
        )
    _band("sensors.force_bandwidth_Hz", sensors.force_bandwidth_Hz, needs.natural_Hz)
    swings = f"the slide slips as it swings on its spring, at {needs.natural_Hz:.3g} Hz"
    lag = rig.effects.get("force-sensor-lag", {})
    one_lag_s, slip_s = float(lag.get("lag_s", 0.0)), 1.0 / (2.0 * math.pi * needs.natural_Hz)
    lags = _LAGS.get(str(lag.get("form", "")), 1.0)
    if lags * one_lag_s > slip_s:
        most, why = (
            f"{_below(0.5 * slip_s / lags):g} or less",
            f"{swings}, and the force is {lags * one_lag_s:g} s behind",
        )
        _refuse("effects.force-sensor-lag.lag_s", one_lag_s, why, most)
    if 1.0 / sample_s < _FEWEST_SAMPLES * needs.natural_Hz:
        least = math.ceil(_FEWEST_SAMPLES * needs.natural_Hz * rig.solver.block_s)
        why = f"{swings}, of which {1.0 / sample_s:g} samples a second show nothing"
        _refuse("solver.samples_per_block", rig.solver.samples_per_block, why, f"{least} or more")


def _band(name: str, band_Hz: float, natural_Hz: float) -> None:
    """Raise ValueError for a signal slower than a slip, which swings at the frequency of the slide on its spring."""
    if band_Hz < natural_Hz:
        why = f"the slide slips as it swings on its spring, at {natural_Hz:.3g} Hz, which is above what this sensor follows"
        _refuse(name, band_Hz, why, f"{_above(2.0 * natural_Hz):g} or more")


def _most_noise_m(in_s: float, speed_mps: float, sample_s: float) -> float:
    """White noise of a position out of which this speed stands by five standard deviations after this time.

    The slope of N samples over T has the variance 12 sigma^2 / (N T^2); docs/method/bank.md.
    """
    return speed_mps * math.sqrt(in_s**3 / (300.0 * sample_s))


def _positions(rig: RigConfig, controller: ControllerConfig, needs: _Needs) -> None:
    sensors, sample_s = rig.sensors, rig.solver.block_s / rig.solver.samples_per_block
    step_m, noise_m = sensors.position_resolution_m, sensors.position_noise_m
    if needs.slip_m > 0.0 and controller.estimator.use_slide_position:
        slip = f"a slip of the slide, {needs.slip_m * 1e6:.3g} um long,"
        if step_m > needs.slip_m / _STEPS_A_SLIP:
            most = f"{_below(needs.slip_m / _STEPS_A_SLIP):g} or less"
            _refuse("sensors.position_resolution_m", step_m, f"{slip} is less than a step of it", most)
        most_m = needs.slip_m / _SIGMAS_A_SLIP * math.sqrt(max(_BIN_S / sample_s, 1.0))
        if not controller.estimator.use_force:  # the position alone shows a stick
            most_m = min(most_m, _most_noise_m(needs.stick_s, needs.fastest_mps, sample_s) / math.sqrt(2.0))
        if noise_m > most_m:
            why = f"{slip} does not stand out from it"
            _refuse("sensors.position_noise_m", noise_m, why, f"{_below(most_m):g} or less")
        _band("sensors.position_bandwidth_Hz", sensors.position_bandwidth_Hz, needs.natural_Hz)
    most_m, rms_m = _most_noise_m(_LONGEST_S, needs.slowest_mps, sample_s), step_m / math.sqrt(12.0)
    if math.hypot(noise_m, rms_m) > most_m:
        why = f"the drive's {needs.slowest_mps * 1e3:.3g} mm/s do not stand out from it within {_LONGEST_S:g} s"
        if rms_m > noise_m:
            _refuse("sensors.position_resolution_m", step_m, why, f"{_below(most_m * math.sqrt(6.0)):g} or less")
        _refuse("sensors.position_noise_m", noise_m, why, f"{_below(most_m / math.sqrt(2.0)):g} or less")


def _base(rig: RigConfig, controller: ControllerConfig, needs: _Needs) -> None:
    """The base accelerometer, by which v_a is measured, at the frequency that the controller would choose."""
    sensors, limits = rig.sensors, controller.limits
    candidates_Hz = np.array(candidate_frequencies_Hz(controller))

    def accel_mps2(v_d_mps: float) -> tuple[float, float]:
        """Largest acceleration of the base at this feed, and its frequency: the cheapest one, as in `controller.frequency`."""
        v_a_mps = min(limits.v_ratio * v_d_mps, limits.velocity_max_mps)
        omega = 2.0 * math.pi * candidates_Hz
        cost = (v_a_mps / omega / limits.amplitude_max_m) ** 2 + (
            omega * v_a_mps / controller.amplitude.accel_range_mps2
        ) ** 2
        best = int(np.argmin(cost))
        reached_mps = min(v_a_mps, float(omega[best]) * min(limits.amplitude_max_m, rig.piezo.amplitude_max_m))
        return float(omega[best]) * reached_mps, float(candidates_Hz[best])

    most_mps2, frequency_Hz = accel_mps2(needs.fastest_mps)
    slip_mps2 = needs.drop_N / rig.slide.mass_kg
    for need_mps2, motion in ((most_mps2, f"v_a at {frequency_Hz:g} Hz has"), (slip_mps2, "a slip has")):
        if need_mps2 > sensors.accel_range_mps2:
            why = f"{motion} an acceleration of {need_mps2:.3g} m/s2: must be more than that"
            _refuse("sensors.accel_range_mps2", sensors.accel_range_mps2, why, f"{_above(_ROOM * need_mps2):g}")
    band_Hz, corrected_Hz = sensors.accel_bandwidth_Hz, controller.amplitude.accel_bandwidth_Hz
    if band_Hz < frequency_Hz and not 1.0 / _SAME_BAND <= corrected_Hz / band_Hz <= _SAME_BAND:
        remedy = f"{_above(2.0 * frequency_Hz):g}, or controller.amplitude.accel_bandwidth_Hz to {band_Hz:g}, to correct for it"
        _refuse("sensors.accel_bandwidth_Hz", band_Hz, f"the base vibrates at {frequency_Hz:g} Hz, above it", remedy)
    if sensors.accel_lowest_Hz > 0.5 * candidates_Hz[0]:
        remedy = f"{_below(0.1 * float(candidates_Hz[0])):g} or less"
        why = f"the base vibrates from {candidates_Hz[0]:g} Hz on"
        _refuse("sensors.accel_lowest_Hz", sensors.accel_lowest_Hz, why, remedy)
    least_mps2, _ = accel_mps2(needs.slowest_mps)
    for name, most_mps2 in (
        ("accel_resolution_mps2", least_mps2 / _STEPS_AN_AMPLITUDE),
        ("accel_noise_mps2", least_mps2 / _LEAST_OVER_NOISE),
    ):
        if (value := getattr(sensors, name)) > most_mps2:
            why = (
                f"at {needs.slowest_mps * 1e3:.3g} mm/s v_a has {least_mps2:.3g} m/s2, which does not stand out from it"
            )
            _refuse(f"sensors.{name}", value, why, f"{_below(most_mps2):g} or less")


def _above(value: float) -> float:
    """The next number of two digits at or above a value."""
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.ceil(value / digit - 1e-9) * digit:.6g}")


def _below(value: float) -> float:
    """The next number of two digits at or below a value; 0 for 0."""
    if value <= 0.0:
        return 0.0
    digit = 10.0 ** (math.floor(math.log10(value)) - 1)
    return float(f"{math.floor(value / digit + 1e-9) * digit:.6g}")
