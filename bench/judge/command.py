"""`python -m bench judge`: every method on cases with known answers, outcome table."""

from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import typer

from bench.judge.scoring import Figures
from cockpit.commands.as_json.option import Json, carry_out, print_result
from cockpit.run.child_process import end_like_ctrl_c
from cockpit.run.writable import writing


class JudgeResult(NamedTuple):
    """Figures of every method, over all cases and by set, and every answer."""

    figures: list[Figures]
    by_set: dict[str, list[Figures]]
    cases: list[dict[str, Any]]


def judge(
    folder: Annotated[Path, typer.Argument(metavar="DIR", help="Cases that `python -m tests.blind develop` made.")],
    method: Annotated[list[str], typer.Option(help="A method; all if not given. Repeatable.")] = [],  # noqa: B006
    set_: Annotated[list[str], typer.Option("--set", help="A set; all if not given. Repeatable.")] = [],  # noqa: B006
    half: Annotated[Literal["a", "b"] | None, typer.Option(help="a: for development; b: for decisions.")] = None,
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 1,
    budget: Annotated[float | None, typer.Option(min=1.0, help="Seconds that a method has for a case.")] = None,
    as_json: Json = None,
) -> None:
    """Ask every method about every case, and print its answers and the truth; kept answers are not asked for again."""

    def work() -> None:
        from bench.judge.cases import read_cases
        from bench.judge.methods import Given, ask, known, methods
        from bench.judge.scoring import Outcome, by_method, case_table, summary
        from cockpit.commands.diagnose_output import watched

        end_like_ctrl_c()
        known(method)
        names = method or list(methods())
        cases = read_cases(folder, set_, half)
        outcomes: list[Outcome] = []
        by_name = {case.name: case for case in cases}
        with writing(), watched() as progress:
            for given in ask(folder, names, cases, jobs, budget):
                outcomes.append(Outcome(by_name[given.case], given))
                progress(f"{given.method}: {given.case}", len(outcomes) / (len(cases) * len(names)))
        for case in cases:
            outcomes += [Outcome(case, Given(old, case.name, answer, None)) for old, answer in case.kept.items()]
        order = {name: number for number, name in enumerate(names)}
        outcomes.sort(
            key=lambda outcome: (outcome.case.group, outcome.case.name, order.get(outcome.given.method, len(order)))
        )
        groups = list(dict.fromkeys(outcome.case.group for outcome in outcomes))
        by_set = {
            group: by_method([outcome for outcome in outcomes if outcome.case.group == group]) for group in groups
        }
        rows = [outcome.given._asdict() | {"truth": outcome.case.truth, "right": outcome.right} for outcome in outcomes]
        result = JudgeResult(by_method(outcomes), by_set, rows)
        lines = [*case_table(outcomes), "", *summary("all", result.figures)]
        for group, rows_of_set in by_set.items():
            lines += ["", *summary(group, rows_of_set)]
        print_result(as_json, result, lines, indent=1)

    carry_out(work, as_json)
