"""The pictures of a diagnosis: measured and predicted cycles, and residuals over the variable that explains them."""

from diagnosis.gap.problem import Point, Problem
from diagnosis.pictures.cycles import ShownSegment, Version, force_picture, most_telling, slip_difference, slip_picture
from diagnosis.pictures.residuals import Overlay, residual_pictures
from diagnosis.result import Picture

_MOST_RUNS = 5  # most runs with a picture of a cycle
_SLIP_DIFFERS = 0.03  # smallest relative difference of two mean slips for which a close-up is drawn


def pictures(
    problem: Problem, nominal: Point, baseline: Point, named: Point | None, effects: tuple[str, ...]
) -> tuple[Picture, ...]:
    """At most ten pictures: the segment of each run that differs most, slips in close-up where they differ, residuals.

    Args:
        problem: the runs to show.
        nominal: the rig as described.
        baseline: the rig without effects, refitted within its tolerances.
        named: the model with the named effects; None when no effect was named.
        effects: the named effects.

    """
    models = [
        Overlay("rig as described", "nominal", {run.file: problem.signals(run, nominal) for run in problem.runs}),
        Overlay("baseline", "retuned", {run.file: problem.signals(run, baseline) for run in problem.runs}),
    ]
    if named is not None:
        label = "with " + " and ".join(effects)
        models.append(Overlay(label, "effect", {run.file: problem.signals(run, named) for run in problem.runs}))
    rig = problem.rig.model_copy(
        update={name: baseline.values[name] for name in problem.rig.tolerance if name in baseline.values}
    )
    residuals = residual_pictures(rig, problem.runs, problem.scales, models[1:], effects)
    return (*_cycles(problem, models), *residuals)


def _cycles(problem: Problem, models: list[Overlay]) -> list[Picture]:
    shown: list[ShownSegment] = []
    for run in problem.runs:
        versions = [Version("measured", "measured", run.signals)]
        versions += [Version(model.label, model.style, model.signals[run.file]) for model in models]
        if run.commands.segments:
            shown.append(most_telling(run, tuple(versions), problem.scales))
    shown.sort(key=lambda segment: -segment.difference)
    shown = sorted(shown[:_MOST_RUNS], key=lambda segment: segment.run.file)
    drawn = [force_picture(segment, problem.scales) for segment in shown]
    for name in ("drive_force_N", "mass_accel_mps2"):
        with_it = [segment for segment in shown if {"drive_force_N", name} <= segment.run.signals.keys()]
        if problem.rig.drive == "spring" and with_it:
            best = max(with_it, key=lambda segment: slip_difference(segment, name, problem.scales))
            picture = slip_picture(best, name, problem.scales)
            if picture is not None and slip_difference(best, name, problem.scales) > _SLIP_DIFFERS:
                drawn.append(picture)
    return drawn
