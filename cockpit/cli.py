"""The `stickslip` command. Each command imports what it needs when it runs, so that `--help` is quick."""

import contextlib
import json
import os
import sys
from collections.abc import Generator
from pathlib import Path
from typing import Annotated

import typer

from bridge.faults import FAULTS, Fault
from cockpit.commands.blind import blind_app
from cockpit.commands.diagnose import diagnose
from cockpit.commands.log import log_app
from cockpit.commands.options import (
    DEFAULT_SCENARIO,
    ChildOf,
    Endpoint,
    Json,
    Lockstep,
    LogFile,
    Prefix,
    ScenarioName,
    Seed,
    Settings,
    as_settings,
)
from cockpit.commands.replay import replay_command
from cockpit.run.child_process import guarded, stop_event
from cockpit.run.writable import check_writable, writing

app = typer.Typer(
    help="Real-time control against stick-slip: run a rig or its stand-in, replay, recover and judge its logs.",
    no_args_is_help=True,
    add_completion=False,
    pretty_exceptions_enable=False,
)


@app.command()
def run(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    rig: Annotated[
        str | None,
        typer.Option("--rig", help="In place of the scenario's rig: a name in deploy/rigs, or a .toml file."),
    ] = None,
    settings: Settings = [],  # noqa: B006 (typer reads the default and never changes it)
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    in_process: Annotated[
        bool, typer.Option("--in-process", help="Lockstep in one process, without a bus: fastest.")
    ] = False,
    log: LogFile = None,
    as_json: Json = False,
) -> None:
    """Run plant, controller and recorder to the end of a scenario and say what came of it."""

    def work() -> int:
        from cockpit.run.run import run_scenario
        from cockpit.run.scenario import rig_setting

        other = [rig_setting(rig)] if rig is not None else []
        changed = [*other, *as_settings(settings, seed, endpoint, prefix)]
        return run_scenario(scenario, changed, lockstep, in_process, log, as_json)

    sys.exit(guarded(work, as_json))


@app.command()
def plant(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    wait_for: Annotated[str, typer.Option(help="Roles that must be on the bus before the first block.")] = "controller",
    child: ChildOf = 0,
) -> None:
    """Serve the stand-in rig of a scenario on the bus."""

    def work() -> None:
        from cockpit.run.scenario import header, load_scenario
        from plant.app import run as serve

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        roles = [role for role in wait_for.split(",") if role]
        if unknown := set(roles) - {"controller", "recorder"}:
            raise Fault(
                "CONFIG", f"--wait-for {wait_for}: {min(unknown)}: must be controller, recorder or both, by comma"
            )
        described = header(made, "plant", lockstep)
        serve(made.rig, made.seed, made.duration_s, made.bus, described, roles, lockstep, stop_event(child))

    sys.exit(guarded(work))


@app.command()
def controller(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    child: ChildOf = 0,
) -> None:
    """Control the rig that is on the bus, with the controller of a scenario."""

    def work() -> None:
        from cockpit.run.scenario import header, load_scenario
        from controller.app import run as control

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        control(made.controller, made.bus, header(made, "controller", lockstep), lockstep, stop_event(child))

    sys.exit(guarded(work))


@app.command("record")
def recorder(
    scenario: ScenarioName = DEFAULT_SCENARIO,
    settings: Settings = [],  # noqa: B006
    seed: Seed = None,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
    lockstep: Lockstep = False,
    log: LogFile = None,
    child: ChildOf = 0,
) -> None:
    """Record everything on the bus until the plant ends its run. A log that is there already is renamed, not overwritten."""

    def work() -> None:
        from bridge.log.recorder import run as record
        from cockpit.run.run import about_run, keep_aside, log_path
        from cockpit.run.scenario import load_scenario

        made = load_scenario(scenario, as_settings(settings, seed, endpoint, prefix))
        path = log_path(log, made.name)

        def ready() -> None:
            # `stickslip run` writes its log anew; started by hand after an incident, the one there holds what happened
            if not child:
                keep_aside(path)

        about, stop = about_run(made, lockstep), stop_event(child)
        record(path, made.bus, ["plant", "controller"], about, lockstep, stop, ready)

    sys.exit(guarded(work))


app.command("recorder", hidden=True)(recorder)  # a child is named by its role


@app.command("stop")
def operator_stop(
    reset: Annotated[bool, typer.Option("--reset", help="Let the controller work again after a stop.")] = False,
    scenario: ScenarioName = DEFAULT_SCENARIO,
    endpoint: Endpoint = None,
    prefix: Prefix = None,
) -> None:
    """Tell a running controller to ramp the vibration down and keep it down, until --reset; exit status 4: nobody obeyed."""

    def work() -> None:
        from bridge.wire import stickslip_pb2 as wire
        from cockpit.run.operator import tell
        from cockpit.run.scenario import load_scenario

        made = load_scenario(scenario, as_settings([], None, endpoint, prefix))
        tell(made.bus, wire.Operator.RESET if reset else wire.Operator.STOP)

    sys.exit(guarded(work))


@contextlib.contextmanager
def _written(out: Path) -> Generator[None]:
    """The work that ends with writing `out`. Raises Fault LOG_WRITE where it cannot, at its start if that is known then."""
    check_writable("--out", out)
    if out.is_dir():
        raise Fault("LOG_WRITE", f"--out {out}: is a folder; give the name of a file in it")
    with writing(out):
        out.parent.mkdir(parents=True, exist_ok=True)
        yield


@app.command()
def reproduce(
    out: Annotated[Path, typer.Option(help="The report, one HTML file.")] = Path("runs/reproduce.html"),
    as_json: Json = False,
) -> None:
    """Redo the paper: its figures, tables and claims, each with its number and whether it holds."""

    def work() -> int:
        from cockpit.paper.page import reproduce as redo

        with _written(out):
            result = redo(out, progress=True)
        print(json.dumps(result.as_json()) if as_json else f"{result.verdict}\nreport   {out}")
        return 0 if result.passed else 1

    sys.exit(guarded(work, as_json))


@app.command("map")
def stability(
    rig: Annotated[str, typer.Option(help="Name of a rig in deploy/rigs, or a .toml file.")] = DEFAULT_SCENARIO,
    settings: Annotated[
        list[str],
        typer.Option(
            "--set", help="Change one value of the rig: key=value, e.g. contact.static_force_N=18. Repeatable."
        ),
    ] = [],  # noqa: B006
    out: Annotated[Path, typer.Option(help="The picture, a PNG file.")] = Path("runs/map.png"),
    as_json: Json = False,
) -> None:
    """Draw where a rig sticks and slips, over drive velocity, stiffness and vibration."""

    def work() -> None:
        from cockpit.judge.stability_map import stability_map
        from cockpit.run.scenario import load_rig

        made = load_rig(rig, settings)
        with _written(out):
            result = stability_map(made, out)
        print(json.dumps(result._asdict()) if as_json else f"{result.answer}\npicture  {out}")

    sys.exit(guarded(work, as_json))


@app.command()
def plot(
    log: Annotated[Path, typer.Argument(help="A run log, .mcap.")],
    out: Annotated[
        Path | None,
        typer.Option(help="The picture, a PNG file; without it, beside LOG under its name.", show_default=False),
    ] = None,
) -> None:
    """Draw the run in a log: drive force, v_a against v_d, and what the controller did."""

    def work() -> None:
        from cockpit.judge.run_plot import plot_run

        picture = out or log.parent / f"{log.stem}.png"
        if picture.resolve() == log.resolve():
            raise Fault("CONFIG", f"--out {picture}: is the log, which the picture would replace; choose another file")
        with _written(picture):
            plot_run(log, picture)
        print(f"picture  {picture}")

    sys.exit(guarded(work))


_NO_FAULTS = {
    "0": "all is well; a diagnosis that was made is, whatever it says",
    "1": "the command did its work, and the run, the log or the comparison is not as it should be; or, with a traceback, "
    "an error of the program: please report it",
    "141": "whoever read the output closed it before its end, as `| head` does; what the command would have ended with is not "
    "known",
}


@app.command()
def explain(
    code: Annotated[
        str, typer.Argument(help="For example ENDPOINT_BUSY, or an exit status; all of them if left out.")
    ] = "",
) -> None:
    """Say what a fault code or an exit status means and what to do."""

    def work() -> int:
        if not code:
            rows = [(kind.exit_status, kind.code) for kind in FAULTS.values()]
            for status, meaning in sorted((*rows, *((int(status), said) for status, said in _NO_FAULTS.items()))):
                print(f"{status:>3}  {meaning}")
            return 0
        if code in _NO_FAULTS:
            print(f"exit status {code}: {_NO_FAULTS[code]}")
            return 0
        kinds = [kind for kind in FAULTS.values() if code.upper() in {kind.code, str(kind.exit_status)}]
        if not kinds:
            statuses = ", ".join(sorted({*_NO_FAULTS, *(str(kind.exit_status) for kind in FAULTS.values())}, key=int))
            print(f"stickslip: {code}: unknown; known: {', '.join(FAULTS)}; exit statuses {statuses}", file=sys.stderr)
            return 2
        print("\n\n".join(f"{kind.code} (exit status {kind.exit_status})\n{kind.help}" for kind in kinds))
        return 0

    sys.exit(guarded(work))


@app.command()
def scenarios(as_json: Json = False) -> None:
    """List the scenarios and rigs that come with the project."""

    def work() -> None:
        from bridge.config import read_toml
        from cockpit.run.scenario import deploy_folder

        found = {
            path.stem: str(read_toml(path).get("description", ""))
            for path in sorted(deploy_folder().glob("scenarios/*.toml"))
        }
        rigs = [path.stem for path in sorted(deploy_folder().glob("rigs/*.toml"))]
        if as_json:
            print(json.dumps({"scenarios": found, "rigs": rigs}))
            return
        for name, description in found.items():
            print(f"{name:<24} {description}")
        print("rigs: " + ", ".join(rigs))

    sys.exit(guarded(work, as_json))


app.command("replay")(replay_command)
app.command()(diagnose)
app.add_typer(log_app, name="log")
app.add_typer(blind_app, name="blind")


def main() -> None:
    """Entry point of the `stickslip` command."""
    # for joblib, which starts its workers with `python -m`: the folder of the person who calls would be searched first, and
    # may hold a plant.py or numpy.py of that person's own
    os.environ["PYTHONSAFEPATH"] = "1"
    app()
