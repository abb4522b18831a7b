"""The figures of a run, and a line of text for each that its scenario does not expect."""

import math
from typing import NamedTuple

import numpy as np

from bench.control import record
from bench.control.oracle import Oracle
from bench.control.run import Judged, of_trials, wrong_from
from bench.control.scenario import BankScenario
from bridge.wire import stickslip_pb2 as wire

_SLOWEST_S = 0.012  # delay of an announcement that is always allowed; noise allows more
_LEAST_SETTLED_S, _LEAST_MOVING_S = 45.0, 150.0  # least motion to judge energy; to judge needless vibration
_MOST_EXCITED, _LEAST_COVERED = 0.02, 0.9995  # bars: share of needless vibration; of blocks with v_a >= v_d
_BLIND_S, _END_S, _END_PERIODS = 1.0, 2.0, 3.0  # latest BLIND; EXCITER_END, plus periods of stick-slip
_ABOVE_S = 0.005  # longest time of v_a above 1.3 times the wanted; a block is added
_SAYS_SO = {"BLIND", "EXCITER_END", "CANNOT_HELP"}  # reasons that report that the controller does not help
_LEFT_ALONE = 0.1  # share of the slips without control from which a run counts as not helped
SILENT = "neither helps nor reports it"


class Figures(NamedTuple):
    """Figures of one run of one subject. Times in s, shares from 0 to 1, -1 if missing."""

    family: str
    scenario: str
    subject: str
    expect: str
    k_d_given: bool  # whether the controller's file gives the drive's stiffness
    duration_s: float
    sticks: int  # number of true sticks that 5 sigma of the noise show, or that were announced
    recalled: int  # number of these sticks that were announced, or began in mode EXCITE
    delays_s: list[float]  # from the begin of a stick to its announcement
    late_ratios: list[float]  # these delays over the allowed delay
    false_claims: int
    slips: int  # slips after the first announcement, once v_a can have reached v_d
    surges: int
    trial_slips: int  # slips and surges in trials without vibration, which do not count as slips or surges
    slips_on_the_way: int  # slips and surges from the first announcement to that time
    slips_from_enabling: int  # slips and surges from enabling on
    energy_ratio: float  # mean v_a^2 over mean v_d^2 while the drive moves, from enabling on
    settled_ratio: float  # mean v_a^2 over mean v_d^2 from 10 s after the first announcement on
    excited_share: float  # vibrated share of the moving time without BLIND
    blind_share: float  # share of the moving time with BLIND
    probe_share: float
    covered: float  # number of blocks in EXCITE in which v_a can reach v_d
    uncovered: float  # number of these blocks in which it does not
    above_s: float  # longest time of v_a above 1.3 times the wanted
    above_limit_s: float
    twice_share: float  # time of motion with v_a above twice the recent largest v_d, over the moving time
    moving_s: float
    error_rms_m: float
    error_peak_m: float
    turns: int  # reversals of the drive
    turn_stick_s: float  # longest stick of the slide after a reversal
    quadrant_m: float  # largest following error after a reversal, minus its mean over the rest of the stroke
    words: dict[str, float]  # reasons of the controller, and the moving time until each was given
    reports: list[str]  # events of rig and controller that report a fault or a limit; see `bench.control.trust.reports`
    counted_from_s: float  # time from which slips and surges are counted
    failures: list[str]
    oracle: Oracle | None  # result of the oracle, for a run of the controller with slips or surges, counted or not


def refused(scenario: BankScenario, subject: str, why: str) -> Figures:
    """The figures of a scenario that the controller does not take."""
    empty = dict.fromkeys(Figures._fields, 0)
    given = {"family": scenario.family, "scenario": scenario.name, "subject": subject, "expect": scenario.bank.expect}
    given |= {"k_d_given": scenario.bank.told.drive_stiffness_given}
    lists = {"delays_s": [], "late_ratios": [], "words": {}, "reports": [], "failures": [f"refused: {why}"]}
    none = {"settled_ratio": -1.0, "oracle": None}
    return Figures(**(empty | given | lists | none))  # pyright: ignore[reportArgumentType]


def figures(scenario: BankScenario, subject: str, judged: Judged, is_controller: bool) -> Figures:
    """The figures of a run.

    Args:
        is_controller: whether the subject is the controller; only its states and reasons are judged.

    """
    sums, events = judged.sums, judged.events
    kinds, begins = events[:, 0], events[:, 1]
    enabled_from_s = scenario.enabled_from_s
    first_s = sums["first_s"]
    from_s = first_s if first_s >= 0.0 else enabled_from_s
    able_s = from_s + (0.15 + 12.0 * judged.loop_delay_s if first_s >= 0.0 else 0.0)
    wrong = wrong_from(events, enabled_from_s)

    sticks = events[kinds == record.STUCK]
    long = (sticks[:, 4] >= 0.0) & (sticks[:, 2] - sticks[:, 1] > sticks[:, 4])
    announced = sticks[:, 5] >= 0.0
    seen = sticks[(long | announced)]
    fresh = seen[(seen[:, 5] >= 0.0) & (seen[:, 6] == 0.0)]
    delays_s = fresh[:, 5] - fresh[:, 1]
    soon_s = np.maximum(_SLOWEST_S, fresh[:, 4])
    moving_s = max(sums["enabled_moving_s"], 1e-9)
    seeing_s = moving_s - sums["blind_s"]
    result = Figures(
        family=scenario.family,
        scenario=scenario.name,
        subject=subject,
        expect=scenario.bank.expect,
        k_d_given=scenario.bank.told.drive_stiffness_given,
        duration_s=judged.duration_s,
        sticks=len(seen),
        recalled=int(np.sum((seen[:, 5] >= 0.0) | (seen[:, 6] == 1.0))),
        delays_s=[round(float(delay_s), 6) for delay_s in delays_s],
        late_ratios=[round(float(late_ratio), 4) for late_ratio in delays_s / soon_s],
        false_claims=int(np.sum(kinds == record.CLAIMED)),
        slips=int(np.sum((kinds == record.SLIPPED) & wrong & (begins > able_s))),
        surges=int(np.sum((kinds == record.SURGED) & wrong & (begins > able_s))),
        trial_slips=int(np.sum(of_trials(events))),
        slips_on_the_way=int(np.sum(wrong & (begins > from_s) & (begins <= able_s))),
        slips_from_enabling=int(np.sum(wrong)),
        energy_ratio=sums["energy"] / max(sums["drive_energy"], 1e-30),
        settled_ratio=sums["settled_energy"] / sums["settled_drive_energy"]
        if sums["settled_s"] > _LEAST_SETTLED_S
        else -1.0,
        excited_share=(sums["excited_s"] - sums["blind_excited_s"]) / seeing_s if seeing_s > 1.0 else 0.0,
        blind_share=sums["blind_s"] / moving_s,
        probe_share=sums["probe_s"] / moving_s,
        covered=sums["covered"],
        uncovered=sums["uncovered"],
        above_s=sums["above_s"],
        above_limit_s=_ABOVE_S + scenario.rig.solver.block_s,
        twice_share=sums["twice_s"] / moving_s,
        moving_s=sums["enabled_moving_s"],
        error_rms_m=math.sqrt(sums["error_square"] / max(sums["moving_s"], 1e-9)),
        error_peak_m=sums["error_peak_m"],
        turns=round(sums["turns"]),
        turn_stick_s=sums["turn_stick_s"],
        quadrant_m=sums["quadrant_m"],
        words={name: moving for name, (_, moving, _) in judged.reasons.items()},
        reports=[],
        counted_from_s=able_s,
        failures=[],
        oracle=None,
    )
    return result._replace(failures=_failures(scenario, result, judged) if is_controller else _broken(judged))


def _broken(judged: Judged) -> list[str]:
    return [f"the state of the rig is NaN or infinite after {judged.duration_s:.3f} s"] if judged.broken else []


def _failures(scenario: BankScenario, run: Figures, judged: Judged) -> list[str]:
    """One line for each bar that this run alone misses."""
    lines, events = _broken(judged), judged.events
    expect = run.expect
    words = judged.reasons
    if expect == "helped" and run.slips + run.surges:
        first = events[wrong_from(events, run.counted_from_s)][0]
        kind = "slip" if first[0] == record.SLIPPED else "surge"
        lines.append(
            f"{run.slips} slips and {run.surges} surges; the first, a {kind}, at {first[1]:.3f} s, "
            f"{first[3]:.1f} v_d, with v_a at {first[4]:.2f} v_d in mode {wire.Mode.Name(round(first[5]))}"
        )
    if run.sticks and run.recalled < run.sticks:
        lost = events[(events[:, 0] == record.STUCK) & (events[:, 5] < 0.0) & (events[:, 6] == 0.0)]
        lost = lost[(lost[:, 4] >= 0.0) & (lost[:, 2] - lost[:, 1] > lost[:, 4])]
        lines.append(
            f"{run.sticks - run.recalled} of {run.sticks} sticks never announced; the first from {lost[0, 1]:.3f} s "
            f"to {lost[0, 2]:.3f} s, where 5 sigma need {1e3 * lost[0, 4]:.1f} ms"
        )
    if run.false_claims:
        at_s = float(events[events[:, 0] == record.CLAIMED][0, 1])
        hourly = run.false_claims / run.duration_s * 3600.0
        lines.append(f"{run.false_claims} false announcements, {hourly:.0f} an hour; the first at {at_s:.3f} s")
    if expect == "not-needed" and run.moving_s >= _LEAST_MOVING_S and run.excited_share > _MOST_EXCITED:
        lines.append(f"vibrated {100 * run.excited_share:.1f} % of {run.moving_s:.0f} s of motion that needs none")
    if run.covered and 1.0 - run.uncovered / run.covered < _LEAST_COVERED:
        lines.append(f"v_a below v_d in {100 * run.uncovered / run.covered:.2f} % of the blocks where it can reach v_d")
    if run.above_s > run.above_limit_s + 1e-9:
        at_s = judged.sums["above_at_s"]
        lines.append(
            f"v_a above 1.3 times the wanted for {1e3 * run.above_s:.0f} ms from {at_s:.3f} s; "
            f"allowed: {1e3 * run.above_limit_s:.0f} ms"
        )
    if expect == "helped" and not _SAYS_SO & set(words) and _is_left_alone(scenario, run, judged):
        lines.append(
            f"{SILENT}: the last third of the run has at least a tenth of the slips that it has without control"
        )
    if expect == "blind" and not ("BLIND" in words and words["BLIND"][1] <= _BLIND_S + 1e-6):
        # a vibration without a slip has helped; a feed that no sensor shows within a second must be reported
        needs_s = (record.seen_m2s(scenario.rig) / scenario.slowest_mps**2) ** (1.0 / 3.0)
        helps = run.slips + run.surges == 0 and judged.sums["first_s"] >= 0.0
        if needs_s > _BLIND_S or not helps:
            lines.append(_too_late("BLIND", words, 1, _BLIND_S))
    if expect == "cannot-help":
        limit_s = _END_S + _END_PERIODS * _period_s(scenario)
        if not ("EXCITER_END" in words and words["EXCITER_END"][2] <= limit_s + 1e-6):
            lines.append(_too_late("EXCITER_END", words, 2, limit_s))
    return lines


def _is_left_alone(scenario: BankScenario, result: Figures, judged: Judged) -> bool:
    """Whether the last third of a run has about a tenth or more of the slips that it would have without control."""
    from_s = max(judged.duration_s * 2.0 / 3.0, result.counted_from_s)
    left_s = (judged.duration_s - from_s) * result.moving_s / max(judged.duration_s - scenario.enabled_from_s, 1e-9)
    many = _LEFT_ALONE * left_s / _period_s(scenario)
    return float(np.sum(wrong_from(judged.events, from_s))) >= max(many, 2.0)


def _period_s(scenario: BankScenario) -> float:
    """Approximate period of stick-slip at the slowest feed: the stick and half a swing of the slide on the drive."""
    contact, drive = scenario.rig.contact, scenario.rig.drive
    swing_N = contact.static_force_N - contact.coulomb_force_N
    natural_s = 2.0 * math.pi * math.sqrt(scenario.rig.slide.mass_kg / drive.stiffness_N_per_m)
    return 2.0 * swing_N / (drive.stiffness_N_per_m * scenario.slowest_mps) + 0.5 * natural_s


def _too_late(word: str, words: dict[str, tuple[float, float, float]], column: int, limit_s: float) -> str:
    spent = "of motion" if column == 1 else "of exciting"
    given = f"reported after {words[word][column]:.2f} s {spent}" if word in words else "never reported"
    return f"{word} {given}; within {limit_s:.2f} s"
