"""The checks of blocks and channels."""

import itertools
import math

import numpy as np

from bridge.arrays import Floats
from bridge.rig.conformance.heard import Stage, joined, level, phasors, strongest
from bridge.rig.conformance.report import Measured, NotSeen
from bridge.rig.conformance.session import Session
from bridge.wire.channels import CHANNELS, SENSOR_CHANNELS

FORCE, SLIDE_ACCEL, BASE, SLIDE, DRIVE = range(len(CHANNELS))
# Deviation of the rate over 3 s. Smaller: blocks that arrive 5 ms early or late. Larger: v_d is as wrong.
_RATE = 5e-3
_COUNT_BLOCKS = 5.0  # difference of the counts over the pause; smaller: a busy computer. Larger: 5 blocks may vanish
# Phase by which the tone may leap from block to block [rad]. Smaller: noise of a tenth of the tone. Larger: a repeated block
# whose length is close to whole periods.
_LEAP_RAD = 0.6
_MOST_LEAPS = 0.005  # share of blocks with a leap
_MANY = 0.1  # share of blocks
_FEW = 3  # filled samples that are accepted: numbers that are equal by chance
_SURE = 10.0  # movement over noise from which its direction is known
_WINDOW_S = 0.05  # time over which positions are compared
_TOO_FAST = 1.5  # as for the guard's DRIVE_FAST
# Correlation of the steps of two channels from which they are one signal. Smaller: two sensors with less noise than motion in
# common. Larger: rounding to 32 bits hides it.
_SAME = 0.9999
_HOLDS = 0.05  # share of equal neighbours up to which a channel has noise, so that a held sample shows


def times(session: Session) -> Measured:
    """Median times of the calls; a call that did not return fails."""
    for name in ("read", "write", "safe", "close", "open"):
        if "did not return" in session.failures.get(name, "") or (name == "read" and name in session.failures):
            return Measured(False, session.failures[name], "every call returns")
    block_s = session.facts.block_s
    reads, writes = (float(np.median(session.longest_s[name] or [0.0])) for name in ("read", "write"))
    passed = writes < block_s and (session.pace != "device" or reads < 3.0 * block_s)
    return Measured(
        passed, f"read {1e3 * reads:.2f} ms, write {1e3 * writes:.2f} ms", f"3 blocks, 1 block of {1e3 * block_s:g} ms"
    )


def opened(session: Session) -> Measured:
    """Whether the device opens."""
    if "open" in session.failures:
        return Measured(False, session.failures["open"], "opens")
    return Measured(True, "opens", "opens")


def shape(session: Session) -> Measured:
    """Type and shape of the samples, signs of the counts."""
    if not session.bad_block and not session.stages.get("rest"):
        raise NotSeen("no block arrived")
    return Measured(not session.bad_block, session.bad_block or "as the rig file states", "as the rig file states")


def numbers(session: Session) -> Measured:
    """Lost blocks, reported problems, and the count over a pause of the reader."""
    off = abs(session.seen_blocks - session.passed_blocks)
    text = f"{session.lost} lost, {len(session.problems)} problems"
    if session.pace == "device":
        text += f", {session.seen_blocks} blocks reported for {session.passed_blocks:.0f}"
    if session.problems:
        text += f", {session.problems[-1]}"
    text = session.bad_count or text
    passed = not session.bad_count and not session.lost and not session.problems and off <= _COUNT_BLOCKS
    return Measured(passed, text, f"0, 0, {_COUNT_BLOCKS:g} apart")


def rate(session: Session) -> Measured:
    """Samples a second by the computer's clock."""
    if session.pace != "device":
        raise NotSeen("the device has no clock")
    rest = session.stage("rest")
    taken_s = rest[-1].at_s - rest[0].at_s
    ratio = (rest[-1].number - rest[0].number) * session.facts.block_s / taken_s
    return Measured(abs(ratio - 1.0) < _RATE, f"{ratio:.4f} of the stated rate", f"within {_RATE:g}")


def missing(session: Session) -> Measured:
    """Share of samples that are not finite."""
    worst = max(_present(session), key=lambda row: float(np.mean(~np.isfinite(_everything(session)[row]))))
    share = float(np.mean(~np.isfinite(_everything(session)[worst])))
    return Measured(share == 0.0, f"{100.0 * share:.3g} % of {CHANNELS[worst]}", "0 %")


def filled(session: Session) -> Measured:
    """Zeros, or repeated samples, in a channel whose noise has none by chance."""
    everything = _everything(session)
    most, text = 0, "none"
    for row in _present(session):
        values = everything[row][np.isfinite(everything[row])]
        _, counts = np.unique(values[values != 0.0], return_counts=True)
        zeros = _zeros(session, row)
        if zeros > 5 * int(counts.max(initial=1)) and zeros > most:
            most, text = zeros, f"{zeros} zeros in {CHANNELS[row]}"
        equal = values[1:] == values[:-1]
        if SENSOR_CHANNELS[CHANNELS[row]].sensor == "accel" and _FEW < np.count_nonzero(equal) < _HOLDS * values.size:
            held = int(np.count_nonzero(equal))
            if held > 5.0 * np.sum(counts / values.size * counts) and held > most:
                most, text = held, f"{held} samples of {CHANNELS[row]} repeat the one before"
    return Measured(most <= _FEW, text, f"{_FEW}")


def _zeros(session: Session, row: int) -> int:
    """Zeros of a channel; blocks of nothing else count unless there are many, as in a simulation without noise."""
    count = session.facts.samples
    zeros = np.array([np.count_nonzero(block.samples[row] == 0.0) for stage in _all_stages(session) for block in stage])
    whole = int(np.count_nonzero(zeros == count))
    return int(zeros[zeros < count].sum()) + (whole * count if whole < _MANY * len(zeros) else 0)


def repeated(session: Session) -> Measured:
    """Blocks that equal one of the four before."""
    count = blocks = 0
    for stage in _all_stages(session):
        blocks += len(stage)
        for at in range(1, len(stage)):
            earlier = stage[max(at - 4, 0) : at]
            moves = np.ptp(stage[at].samples, axis=1).max() > 0.0
            count += moves and any(
                np.array_equal(stage[at].samples, other.samples, equal_nan=True) for other in earlier
            )
    return Measured(not count, f"{count} of {blocks} blocks", "0")


def order(session: Session) -> Measured:
    """Leaps of the tone's phase from block to block: lost, repeated, swapped or shifted blocks that the numbers do not show."""
    leaps = blocks = 0
    for frequency_Hz in session.facts.tones_Hz:
        stage = settled(session, f"tone {frequency_Hz:g}")
        heard = strongest(joined(stage)[BASE], session.facts.rate_Hz)
        turned = np.angle(
            np.exp(1j * np.diff(np.unwrap(np.angle(phasors(stage, heard.frequency_Hz, session.facts.rate_Hz)))))
        )
        leaps += int(np.count_nonzero(np.abs(turned - np.median(turned)) > _LEAP_RAD))
        blocks += len(turned)
    return Measured(leaps <= _MOST_LEAPS * blocks, f"{leaps} leaps in {blocks} blocks", f"{100.0 * _MOST_LEAPS:g} %")


def values(session: Session) -> Measured:
    """Each channel changes by itself, in SI units and within its stated range."""
    everything = _everything(session)
    for row in _present(session):
        name, known = CHANNELS[row], SENSOR_CHANNELS[CHANNELS[row]]
        low, high = float(np.nanmin(everything[row])), float(np.nanmax(everything[row]))
        lowest, highest = session.facts.ranges[name]
        if low == high and known.sensor != "position":
            return Measured(False, f"{name} stays at {low:g}", "changes")
        if max(abs(low), abs(high)) > known.largest:
            return Measured(False, f"{name} up to {max(abs(low), abs(high)):.3g}", f"{known.largest:g} in SI units")
        if (lowest is not None and low < lowest) or (highest is not None and high > highest):
            return Measured(False, f"{name} from {low:.3g} to {high:.3g}", "the range of the rig file")
    measured = [row for row in _present(session) if CHANNELS[row] not in session.facts.derived]
    for first, second in itertools.combinations(measured, 2):
        steps = np.diff(everything[[first, second]])
        steps = steps[:, np.isfinite(steps).all(axis=0)]
        if steps.size and steps.std(axis=1).all() and abs(np.corrcoef(steps)[0, 1]) > _SAME:
            return Measured(False, f"{CHANNELS[first]} and {CHANNELS[second]} are one signal", "each its own source")
    return Measured(True, "every channel changes", "changes, in SI units")


def positions(session: Session) -> Measured:
    """Drive and slide move the same way and as far; while one rests, it is the slide; the drive is not too fast."""
    if _is_absent(session, "mass_position_m"):
        raise NotSeen("mass_position_m is absent")
    rows = [_means(session, row) for row in (SLIDE, DRIVE)]
    noise_m = max(float(np.median(np.abs(np.diff(values_m)))) for values_m in rows)
    way_m = [float(values_m[-1] - values_m[0]) for values_m in rows]
    if max(map(abs, way_m)) < _SURE * max(noise_m, 1e-9):
        raise NotSeen("the drive is at rest")
    window = max(round(_WINDOW_S / session.facts.block_s), 1)
    steps = [np.abs(np.diff(values_m[::window])) for values_m in rows]
    least_m = max(_SURE * noise_m, 0.02 * max(float(step.max(initial=0.0)) for step in steps))
    stick, creep = (int(np.count_nonzero((steps[a] > least_m) & (steps[b] <= least_m))) for a, b in ((1, 0), (0, 1)))
    speed_mps = float(np.median(steps[1])) / _WINDOW_S
    text = f"drive {way_m[1]:.3g} m, slide {way_m[0]:.3g} m"
    if creep > max(3 * stick, 5):
        return Measured(
            False, f"the slide moves while the drive rests, in {creep} of {len(steps[0])} windows", "the drive leads"
        )
    if speed_mps > _TOO_FAST * session.facts.fastest_mps:
        return Measured(
            False, f"the drive at {speed_mps:.3g} m/s", f"guard.fastest_drive_mps = {session.facts.fastest_mps:g}"
        )
    is_other_way = abs(way_m[0]) > 0.2 * abs(way_m[1]) and way_m[0] * way_m[1] < 0.0
    return Measured(
        not is_other_way and abs(way_m[0]) < 5.0 * abs(way_m[1]), text, "one direction, as far as a spring gives way"
    )


def force(session: Session) -> Measured:
    """The force rises as the drive leads the slide."""
    if _is_absent(session, "drive_force_N") or _is_absent(session, "mass_position_m"):
        raise NotSeen("drive_force_N or mass_position_m is absent")
    extension_m, force_N = _means(session, DRIVE) - _means(session, SLIDE), _means(session, FORCE)
    noise_m = float(np.median(np.abs(np.diff(extension_m))))
    if float(np.ptp(extension_m)) < _SURE * max(noise_m, 1e-12):
        raise NotSeen("the extension of the drive does not change")
    together = float(np.corrcoef(extension_m, force_N)[0, 1])
    if abs(together) < 0.5:
        raise NotSeen(f"force and extension correlate by {together:.2f} only")
    return Measured(together > 0.0, f"correlation {together:.2f} with the extension", "above 0")


def slide_acceleration(session: Session) -> Measured:
    """The slide's acceleration agrees with its position in sign and size."""
    if _is_absent(session, "mass_accel_mps2") or _is_absent(session, "mass_position_m"):
        raise NotSeen("mass_accel_mps2 or mass_position_m is absent")
    blocks = max(round(0.004 / session.facts.block_s), 1)
    length_s = blocks * session.facts.block_s
    rows = [_means(session, row) for row in (SLIDE, SLIDE_ACCEL)]
    rows = [row[: len(row) // blocks * blocks].reshape(-1, blocks).mean(axis=1) for row in rows]
    from_position = np.diff(rows[0], 2) / length_s**2
    measured = np.convolve(rows[1] - np.median(rows[1]), (0.25, 0.5, 0.25), "valid")
    noise = float(np.median(np.abs(from_position))) / 0.67
    fast = np.abs(from_position) > max(_SURE * noise, 1e-9)
    if np.count_nonzero(fast) < 4:
        raise NotSeen("the slide has no fast motion")
    ratio = float(measured[fast] @ from_position[fast] / (from_position[fast] @ from_position[fast]))
    return Measured(1 / 3 < ratio < 3.0, f"{ratio:.3g} of its position's second derivative", "1/3 to 3")


def settled(session: Session, name: str) -> Stage:
    """The end of a stage, once its vibration is steady. Raises NotSeen."""
    facts, stage = session.facts, session.stage(name)
    first = round((facts.ramp_s + facts.answer_s + 0.02) / facts.block_s)
    if len(stage) < first + 4:
        raise NotSeen(f"the session ended before the stage {name!r}")
    return stage[first:]


def _present(session: Session) -> list[int]:
    if not session.stage("rest"):
        raise NotSeen("no blocks at rest")
    return [row for row, name in enumerate(CHANNELS) if name not in session.facts.absent]


def _is_absent(session: Session, name: str) -> bool:
    return CHANNELS.index(name) not in _present(session)


def _all_stages(session: Session) -> list[Stage]:
    return [stage for stages in session.stages.values() for stage in stages]


def _everything(session: Session) -> Floats:
    return joined([block for stage in _all_stages(session) for block in stage])


def _means(session: Session, row: int) -> Floats:
    """Mean of a channel in each block at rest; a block without a number repeats the one before."""
    means = np.array([block.samples[row].mean() for block in session.stage("rest")])
    bad = ~np.isfinite(means)
    if bad.all() or not means.size:
        raise NotSeen(f"{CHANNELS[row]} has no samples")
    at = np.where(~bad, np.arange(means.size), 0)
    np.maximum.accumulate(at, out=at)
    return np.where(np.isfinite(means[at]), means[at], means[~bad][0])


def largest_tone(session: Session, stage: Stage, frequency_Hz: float) -> dict[str, tuple[float, float]]:
    """Level of a tone in each present channel, and its level at rest."""
    rest = session.stage("rest")
    rate_Hz = session.facts.rate_Hz
    count = min(len(rest), len(stage))
    return {
        CHANNELS[row]: (
            level(joined(stage)[row], frequency_Hz, rate_Hz),
            max(level(joined(rest[:count])[row], frequency_Hz, rate_Hz), math.ulp(1.0)),
        )
        for row in _present(session)
    }
