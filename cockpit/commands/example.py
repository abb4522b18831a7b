"""`stickslip example`: evidence of a simulated rig with a hidden fault, for a first diagnosis."""

from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Annotated, Literal, NamedTuple

import typer

from bridge.faults import Fault
from cockpit.commands.as_json.option import STDOUT, Json, print_result
from cockpit.commands.options import command, watched_share
from cockpit.run.child_process import end_like_ctrl_c
from cockpit.run.writable import check_output_folder, writing

# sizes large enough that a diagnosis of these runs identifies the effect
_EFFECTS: dict[str, dict[str, dict[str, float | str]]] = {
    "none": {},
    "drive-damping": {"drive-damping": {"damping_Ns_per_m": 12.0}},
    "drive-backlash": {"drive-backlash": {"gap_m": 1e-4}},
    "force-sensor-gain": {"force-sensor-gain": {"ratio": 0.1}},
}
_HIDDEN = "drive-damping"


class Example(NamedTuple):
    """Result of the command."""

    folder: str
    runs: list[str]  # data files
    held_out: list[str]  # data files to which no number is fitted
    seed: int
    effects: dict[str, dict[str, float | str]] | None  # effects with their numbers; None: hidden


@command()
def example(
    folder: Annotated[Path, typer.Argument(help="Evidence folder to make; it must not exist yet.")],
    seed: Annotated[int, typer.Option(min=0, help="Seed of the rig's numbers, noise and surface.")] = 1,
    effect: Annotated[
        Literal["none", "drive-damping", "drive-backlash", "force-sensor-gain"] | None,
        typer.Option(help="Effect to simulate in place of the hidden one; none: the rig is as described."),
    ] = None,
    as_json: Json = None,
) -> None:
    """Simulate evidence of a rig with a hidden fault: four runs with noise, for a first diagnosis."""
    from diagnosis.evidence.manifest import read_manifest
    from diagnosis.synthetic.folder import Case, make_evidence

    end_like_ctrl_c()
    if folder.exists() or folder.is_symlink():
        raise Fault("CONFIG", f"{folder}: exists already; nothing was written; choose another folder")
    check_output_folder("FOLDER", folder)
    parent_folder = next(parent for parent in folder.absolute().parents if parent.exists())
    with (
        writing(folder),
        TemporaryDirectory(prefix=".stickslip-", dir=parent_folder) as part,
        watched_share(f"making {folder}", quiet=as_json == STDOUT) as progress,
    ):
        make_evidence(Path(part, "made"), Case(effects=_EFFECTS[effect or _HIDDEN]), seed, progress)
        folder.parent.mkdir(parents=True, exist_ok=True)
        Path(part, "made").rename(folder)
    runs = read_manifest(folder).run
    held_out = [run.file for run in runs if run.holdout]
    made = Example(
        str(folder), [run.file for run in runs], held_out, seed, None if effect is None else _EFFECTS[effect]
    )
    chosen = "a rig as described" if effect == "none" else f"a rig with {effect}"
    if effect is not None:
        chosen += "".join(f", {name} = {number}" for name, number in _EFFECTS[effect].get(effect, {}).items())
    rig = "a rig with a hidden fault" if effect is None else chosen
    print_result(
        as_json,
        made,
        [
            f"{folder}: {len(runs)} runs of {rig}, {len(made.held_out)} of them held out; manifest.toml describes the rig",
            f"next     stickslip diagnose {folder}",
        ],
    )
