"""`python -m tests.blind make`: a set of rigs with sealed answers, for `python -m bench blind run` and `score`."""

import sys
from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from bridge.faults import Fault
from cockpit.run.child_process import end_like_ctrl_c, exit_status_of
from cockpit.run.writable import check_writable, writing

app = typer.Typer(
    help="Sealed cases for the diagnosis.", no_args_is_help=True, add_completion=False, pretty_exceptions_enable=False
)


class GeneratorName(StrEnum):
    """Where the rigs come from."""

    independent = "independent"
    independent_2 = "independent-2"
    workshop = "workshop"
    plant = "plant"


@app.callback()
def commands() -> None:
    """Make sealed cases that `python -m bench blind run` diagnoses and `python -m bench blind score` opens."""


@app.command("make")
def make(
    cases: Annotated[int, typer.Option(help="How many; 200 or more tell something.")],
    seed: Annotated[
        int,
        typer.Option(min=0, help="The same seed makes the same evidence, under other names; once opened it is spent."),
    ],
    out: Annotated[Path, typer.Option(metavar="DIR", help="The set: a new folder.")],
    key: Annotated[Path, typer.Option(help="The key file with the answers, outside DIR.")],
    generator: Annotated[
        GeneratorName,
        typer.Option(
            help="Formulas of their own (independent-2: other effects outside the library), or those that the diagnosis tries."
        ),
    ] = GeneratorName.independent,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")] = None,
) -> None:
    """Make evidence folders with random names, and a key with the answers.

    That takes half a minute to a minute a case and core. It can be stopped and taken up again.
    """

    def work() -> None:
        from joblib import cpu_count

        from cockpit.commands.diagnose_output import watched
        from tests.blind.making import make_set

        end_like_ctrl_c()
        check_writable("--key", key)
        with writing(), watched() as progress:
            make_set(out, key, generator.value, cases, seed, jobs or cpu_count(), progress)
        print(f"{cases} cases    {out}\nkey         {key}\nnext        python -m bench blind run {out}")

    sys.exit(exit_status_of(work))


@app.command("develop")
def develop(
    out: Annotated[Path, typer.Argument(metavar="DIR", help="Folder of the sets; finished cases stay.")],
    sets: Annotated[
        list[str] | None, typer.Option("--set", help="plant, foreign, machines, opened, measured; all. Repeatable.")
    ] = None,
    count: Annotated[int, typer.Option(min=5, help="Cases of a set that is drawn.")] = 30,
    seed: Annotated[int, typer.Option(min=0, help="Another seed draws other cases.")] = 1,
    limits: Annotated[bool, typer.Option("--limits", help="Measure detection limits: 20 s of CPU an effect.")] = False,
    jobs: Annotated[int, typer.Option(min=1, help="Processes to use.")] = 1,
) -> None:
    """Make cases with known answers for `python -m bench judge`."""

    def work() -> None:
        from tests.blind.judge_sets import SETS
        from tests.blind.judge_sets import develop as made

        end_like_ctrl_c()
        unknown = set(sets or ()) - SETS.keys()
        if unknown:
            raise Fault("CONFIG", f"--set {min(unknown)}: no such set; there are {', '.join(SETS)}")
        with writing():
            for number, name in enumerate(made(out, sets or list(SETS), count, seed, jobs, limits), 1):
                print(f"{number:4d}  {name}", flush=True)

    sys.exit(exit_status_of(work))


if __name__ == "__main__":
    app(prog_name="python -m tests.blind")
