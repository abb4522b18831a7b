"""The checks of the vibration: it answers, as ordered and as reported, and every way to end it ends it."""

import math

import numpy as np

from bridge.arrays import Floats
from bridge.rig.conformance.data import BASE, largest_tone, settled
from bridge.rig.conformance.heard import Stage, Tone, displacements, joined, strongest
from bridge.rig.conformance.report import Measured, NotSeen
from bridge.rig.conformance.session import Session

_ANSWERS = 5.0  # tone over its level at rest from which the exciter answers
_TWICE = 1.5  # largest factor between the delivered and the ordered amplitude, as for the first loop check
_FREQUENCY = 0.01  # deviation of the frequency; a wrong rate of 3 % is one of 3 %
_BEGUN = (
    0.03  # share of the amplitude from which a vibration has begun; the first block of a ramp of 10 blocks has 0.05
)
_HELD = 1.02  # largest amplitude over its limit; the command is 1.05 of it
_ENDED = 0.2  # share of the amplitude below which a vibration has ended
_REST_PARTS = 16  # parts of the time at rest in which the strongest tone is looked for
# Difference of the reported from the delivered amplitude, as a share of the full one. Smaller: a report at the block's end
# differs from the block's mean by 0.05 on a ramp. Larger: an echo of the order on a ramp of 10 blocks differs by 0.5.
_REPORT = 0.25


def rest(session: Session) -> Measured:
    """No vibration is reported or measured without an order."""
    stage, facts = session.stage("rest"), session.facts
    if not stage:
        raise NotSeen("no blocks at rest")
    reported_m = max(block.amplitude_m if math.isfinite(block.amplitude_m) else math.inf for block in stage)
    return Measured(
        reported_m <= _ENDED * facts.amplitude_m, f"{reported_m:.2g} m reported", f"{_ENDED * facts.amplitude_m:.2g} m"
    )


def channels(session: Session) -> Measured:
    """The tone is in the base's accelerometer, not in another channel alone."""
    frequency_Hz = session.facts.tones_Hz[0]
    tones = largest_tone(session, settled(session, f"tone {frequency_Hz:g}"), frequency_Hz)
    base, quiet = tones.pop("base_accel_mps2")
    expected = session.facts.gain * session.facts.amplitude_m * (2.0 * math.pi * frequency_Hz) ** 2
    for name, (tone, rest_level) in tones.items():
        is_silent = base < _ANSWERS * quiet and tone > 4.0 * _ANSWERS * rest_level
        is_other = name == "mass_accel_mps2" and base < 0.5 * expected and expected / _TWICE < tone < expected * _TWICE
        if is_silent or is_other:
            return Measured(
                False, f"{name} has the tone, {tone:.3g}; base_accel_mps2 {base:.3g}", "base_accel_mps2 has it"
            )
    return Measured(True, f"base_accel_mps2 {base:.3g} m/s2", "base_accel_mps2 has it")


def answers(session: Session) -> Measured:
    """The base vibrates once it is ordered."""
    if "write" in session.failures or "enable" in session.failures:
        return Measured(False, session.failures.get("write", session.failures.get("enable", "")), "takes orders")
    if not channels(session).passed:
        raise NotSeen("another channel has the tone")
    frequency_Hz = session.facts.tones_Hz[0]
    stage = settled(session, f"tone {frequency_Hz:g}")
    tone, rate_Hz = _tone(session, frequency_Hz), session.facts.rate_Hz
    base = joined(session.stage("rest")[: len(stage)])[BASE]
    quiet = max(strongest(base, rate_Hz).amplitude, math.ulp(1.0))
    return Measured(
        tone.amplitude > _ANSWERS * quiet,
        f"{tone.amplitude / quiet:.3g} times the strongest tone at rest",
        f"{_ANSWERS:g}",
    )


def frequency(session: Session) -> Measured:
    """The frequency is the ordered one."""
    ratios = [_tone(session, ordered_Hz).frequency_Hz / ordered_Hz for ordered_Hz in session.facts.tones_Hz]
    worst = max(ratios, key=lambda ratio: abs(math.log(max(ratio, 1e-9))))
    return Measured(abs(worst - 1.0) < _FREQUENCY, f"{worst:.4f} of the order", f"within {_FREQUENCY:g}")


def amplitude(session: Session) -> Measured:
    """The amplitude is the ordered one, whole and half."""
    facts = session.facts
    stages = [(f"tone {ordered_Hz:g}", 1.0) for ordered_Hz in facts.tones_Hz] + [("half", 0.5)]
    ratios: list[float] = []
    for name, share in stages:
        stage = settled(session, name)
        heard_Hz = max(strongest(joined(stage)[BASE], facts.rate_Hz).frequency_Hz, 1.0)
        ratios.append(
            float(np.median(displacements(stage, heard_Hz, facts.rate_Hz))) / (share * facts.gain * facts.amplitude_m)
        )
    worst = max(ratios, key=lambda ratio: abs(math.log(max(ratio, 1e-9))))
    return Measured(1.0 / _TWICE < worst < _TWICE, f"{worst:.3g} of the order", f"{1.0 / _TWICE:.2f} to {_TWICE:g}")


def reported(session: Session) -> Measured:
    """Each block reports the vibration that it contains, on ramps too."""
    facts, ordered_Hz = session.facts, session.facts.tones_Hz[0]
    stages = session.stages[f"tone {ordered_Hz:g}"] + _steps(session)
    blocks = max(round(facts.ramp_s / facts.block_s), 1)
    begins, steady, hertz = [], [], []
    for stage in stages:
        delivered = _delivered(session, stage)
        shown = np.array([block.amplitude_m for block in stage]) / facts.amplitude_m
        first = int(np.argmax((delivered > _BEGUN) | (shown > _BEGUN)))
        off = np.abs(shown - delivered)
        begins.append(float(np.median(off[first : first + blocks])) if blocks > 2 else 0.0)
        steady.append(float(np.median(off[-10:])))
        hertz.append(stage[-1].frequency_Hz / ordered_Hz)
    worst, hertz_off = max(np.median(begins), np.median(steady)), abs(float(np.median(hertz)) - 1.0)
    text = f"{worst:.2f} of the amplitude apart, frequency {1.0 + hertz_off:.3f}"
    return Measured(bool(worst < _REPORT) and hertz_off < _FREQUENCY, text, f"{_REPORT:g}, within {_FREQUENCY:g}")


def answer_time(session: Session) -> Measured:
    """Blocks from an order to its begin in the samples; the fastest of five."""
    facts = session.facts
    delays: list[int] = []
    for stage in _steps(session):
        begun = _delivered(session, stage) > _BEGUN
        if begun.any():
            delays.append(stage[int(np.argmax(begun))].number - stage[0].number)
    if not delays:
        raise NotSeen("no step of the vibration was seen")
    limit = facts.answer_blocks + math.ceil(facts.answer_s / facts.block_s)
    return Measured(min(delays) <= limit, f"{min(delays)} blocks", f"{limit} blocks")


def zero(session: Session) -> Measured:
    """An order of 0 ends the vibration as fast as its ramp."""
    return _ended(session, session.stages["zero"][-1][-4:])


def enable(session: Session) -> Measured:
    """Nothing vibrates while the enable line is off."""
    if not session.facts.has_line:
        raise NotSeen("the rig has no enable line")
    return _ended(session, session.stage("off")[-10:])


def safe(session: Session) -> Measured:
    """`safe` ends the vibration; the next order begins it again."""
    if "safe" in session.failures:
        return Measured(False, session.failures["safe"], "raises nothing")
    again = session.stage("before silence") or session.stage("before close")
    if again and float(np.median(_delivered(session, again[-4:]))) < _ENDED:
        return Measured(False, "no order acts after it", "the next order acts")
    return _ended(session, session.stage("safe")[-4:])


def watchdog(session: Session) -> Measured:
    """The device ends the vibration by itself within its stated time without an order."""
    if session.facts.watchdog_s == 0.0:
        raise NotSeen("exciter.watchdog_s = 0: without a watchdog a killed process leaves it vibrating")
    if session.pace != "device":
        raise NotSeen("the device waits for each order")
    return _ended(session, session.stage("silence")[-4:])


def armed(session: Session) -> Measured:
    """A rig with a guard does not vibrate before it is armed."""
    if not session.has_guard:
        raise NotSeen("the rig has no guard")
    return _ended(session, session.stage("not armed")[-10:])


def ramp(session: Session) -> Measured:
    """The amplitude rises no faster than the stated rate."""
    facts = session.facts
    if facts.ramp_s < 4.0 * facts.block_s:
        raise NotSeen("limits.slew_m_per_s: not stated, or as fast as four blocks")
    delivered = np.median(
        [_delivered(session, stage)[: round(2.0 * facts.ramp_s / facts.block_s)] for stage in _steps(session)], 0
    )
    rise = np.flatnonzero(delivered > 0.8)[:1].sum() - np.flatnonzero(delivered > 0.2)[:1].sum()
    took_s = float(rise + 1) * facts.block_s
    return Measured(
        took_s > 0.4 * facts.ramp_s, f"{1e3 * took_s:.3g} ms from 20 to 80 %", f"{400.0 * facts.ramp_s:.3g} ms or more"
    )


def limit(session: Session) -> Measured:
    """A command above the stated stroke is held at it."""
    facts, stage = session.facts, session.stage("limit")
    if not stage:
        raise NotSeen("the session has no blocks of it")
    full = 1.0 / facts.check_share
    share = (
        float(max(np.max(_delivered(session, stage)), max(block.amplitude_m for block in stage) / facts.amplitude_m))
        / full
    )
    return Measured(share < _HELD, f"{share:.3f} of limits.amplitude_max_m", f"{_HELD:g}")


def silence(session: Session) -> Measured:
    """Without commands the vibration ends by itself."""
    if not session.stage("silence"):
        raise NotSeen("in lockstep each block waits for its command")
    return _ended(session, session.stage("silence")[-4:])


def stop(session: Session) -> Measured:
    """An operator's STOP ends the vibration against the controller's commands."""
    if not session.has_guard:
        raise NotSeen("the rig has no guard: its controller stops")
    return _ended(session, session.stage("stop")[-4:])


def close(session: Session) -> Measured:
    """After `close` nothing vibrates, and the device can be opened again."""
    if "close" in session.failures:
        return Measured(False, session.failures["close"], "raises nothing")
    if session.pace == "caller" and not session.stage("closed"):
        raise NotSeen("the device makes no block without an order")
    return _ended(session, session.stage("closed"))


def _steps(session: Session) -> list[Stage]:
    if not session.stages.get("step"):
        raise NotSeen("the session has no steps of the vibration")
    return session.stages["step"]


def _tone(session: Session, ordered_Hz: float) -> Tone:
    return strongest(joined(settled(session, f"tone {ordered_Hz:g}"))[BASE], session.facts.rate_Hz)


def _delivered(session: Session, stage: Stage, at_Hz: float | None = None) -> Floats:
    """Measured amplitude in each block, over the steady one; at a frequency, by default the ordered one."""
    facts, ordered_Hz = session.facts, session.facts.tones_Hz[0]
    steady_m = float(np.median(displacements(settled(session, f"tone {ordered_Hz:g}"), ordered_Hz, facts.rate_Hz)))
    return displacements(stage, at_Hz or ordered_Hz, facts.rate_Hz) / max(steady_m, 1e-15)


def _ended(session: Session, stage: Stage) -> Measured:
    if not stage:
        raise NotSeen("the session has no blocks of it")
    share = max(float(np.median(_delivered(session, stage, at_Hz))) for at_Hz in (None, _other_Hz(session, stage)))
    return Measured(share < _ENDED, f"{100.0 * share:.3g} % of the vibration is left", f"{100.0 * _ENDED:g} %")


def _other_Hz(session: Session, stage: Stage) -> float | None:
    """Frequency of the strongest tone in the exciter's range; None if it is as weak as at rest."""
    limits, rate_Hz, rest = session.facts.limits, session.facts.rate_Hz, session.stage("rest")
    tone = strongest(joined(stage)[BASE], rate_Hz)
    parts = (rest[at : at + len(stage)] for at in range(0, len(rest), max(len(rest) // _REST_PARTS, 1)))
    loudest = max(strongest(joined(part)[BASE], rate_Hz).amplitude for part in parts)
    is_in_range = limits.frequency_min_Hz <= tone.frequency_Hz <= limits.frequency_max_Hz
    return tone.frequency_Hz if is_in_range and tone.amplitude > _ANSWERS * loudest else None
