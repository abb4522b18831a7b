"""`python -m bench trust`: figures of trust in the controller."""

from typing import Annotated

import typer

from cockpit.commands.as_json.option import Json, carry_out, print_result
from cockpit.run.child_process import end_like_ctrl_c


def trust(
    seed: Annotated[int, typer.Option(help="Seed of the drawn axes.")] = 1,
    only: Annotated[
        list[str], typer.Option(help="A part: drawn, never, disturbed, restick, trials; all if not given. Repeatable.")
    ] = [],  # noqa: B006
    axes: Annotated[int, typer.Option(min=1, help="Number of drawn axes, half of them without k_d.")] = 120,
    never: Annotated[int, typer.Option(min=1, help="Number of axes that never stick.")] = 30,
    never_s: Annotated[float, typer.Option("--never-s", min=20.0, help="Duration of their runs.")] = 300.0,
    trials: Annotated[int, typer.Option(min=1, help="Number of drawn axes whose trials are counted.")] = 12,
    trials_s: Annotated[float, typer.Option("--trials-s", min=20.0, help="Duration of their runs.")] = 1260.0,
    rule: Annotated[bool, typer.Option(help='Run the rule "1.2 v_d while it moves", too.')] = True,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")] = None,
    as_json: Json = None,
) -> None:
    """Measure drawn axes, axes that never stick, disturbed runs, re-sticks and the cost of trials, by the plant's truth."""

    def work() -> int:
        from joblib import cpu_count

        from bench.control.trust.result import PARTS, trust
        from bridge.faults import Fault
        from cockpit.commands.diagnose_output import watched

        end_like_ctrl_c()
        if unknown := [part for part in only if part not in PARTS]:
            raise Fault("CONFIG", f"--only {unknown[0]}: no such part; parts: {', '.join(PARTS)}")
        with watched() as progress:
            result = trust(
                seed,
                only or PARTS,
                (axes, never, trials),
                (never_s, trials_s),
                rule,
                jobs or cpu_count(),
                lambda share, line: progress(line, share),
            )
        print_result(as_json, result, result.in_words(), indent=1)
        return 0

    carry_out(work, as_json)
