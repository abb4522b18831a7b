"""Reasons for which a run does not test its controller, in words."""

from collections.abc import Mapping

from cockpit.judge.phases import Phase, PhaseSum
from cockpit.judge.setup import SETTLING_S, Setup
from cockpit.judge.watches import StepWatch


def untested(
    setup: Setup,
    steps: StepWatch,
    seconds: float,
    unreadable: str,
    answered: bool,
    after: Phase | None,
    in_charge_s: float,
) -> str:
    """Reason for which nothing was tested; empty if something was.

    Args:
        setup: numbers of the run.
        steps: watch of the controller's steps.
        seconds: end of the last block; 0 without any.
        unreadable: error of the first unreadable block; empty without any.
        answered: at least one block had a fresh command.
        after: the stretch in which the controller is judged.
        in_charge_s: time in which the controller was in charge, including its settling.

    """
    if setup.imported:
        return "measured data of another program: no controller to judge"
    if not seconds:
        return (
            f"no block can be read: {unreadable}; every block must have all channels"
            if unreadable
            else "no block was recorded"
        )
    if not steps.steps:
        return "no step of a controller was recorded: nothing was tested"
    if not steps.armed:
        return "the rig was never armed: `stickslip arm`, or `arm = true` in the scenario of a simulated rig"
    if not steps.moved:
        return "the drive never moved: nothing was tested"
    if after is not None:
        return ""
    if seconds < setup.enabled_from_s:
        return f"ended before the controller was enabled (at {setup.enabled_from_s:.1f} s)"
    if in_charge_s <= 0.0 or not answered:
        return "the controller was not in charge in this run"
    why = f"too short to judge: it has {SETTLING_S:g} s to settle"
    if in_charge_s > SETTLING_S:  # the force is not finite, or stops and stalls left no second to settle
        why = "but none of it can be judged"
    return f"the controller was in charge for {in_charge_s:.2g} s, {why}"


def too_little(after: Phase | None, phases: Mapping[str, PhaseSum], block_s: float) -> str:
    """Reason for which the controlled motion is too short to show a slip; empty if it is long enough."""
    if after is None:
        return ""
    moving_s, before = phases["after"].moving * block_s, phases["before"]
    if not moving_s:
        return f"the drive did not move in the {after.seconds:.2g} s with the controller in charge"
    if before.slips and moving_s < (period_s := before.moving * block_s / before.slips):
        line = f"the drive moved for {moving_s:.2g} s with the controller in charge"
        return f"{line}, less than the {period_s:.2g} s between two slips before: make the run longer"
    return ""
