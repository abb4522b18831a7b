"""`stickslip look`: estimates from a measured file."""

from pathlib import Path
from typing import Annotated, Any

import typer

from bridge.faults import Fault
from bridge.files import check_file, refuse_to_lose, refuse_to_replace_corrected
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import command
from cockpit.look.quantity import quantity, turns
from cockpit.run.writable import PAGE, PICTURE, RIG, SHEETS, check_output, writing

_OUTPUTS = (*PAGE, *SHEETS, *PICTURE, *RIG)


@command()
def look(
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="Measured data in any format of `log import`, or a run log.")
    ],
    speed: Annotated[str, typer.Option(help="Drive speed, e.g. 0.5mm/s; for stiffness and mass.")] = "",
    load: Annotated[str, typer.Option(help="Normal load, e.g. 94.5N; for friction coefficients.")] = "",
    mass: Annotated[str, typer.Option(help="Known mass of the slide, e.g. 1.5kg; compared with the estimate.")] = "",
    rate: Annotated[str, typer.Option(help="Sampling rate, e.g. 1kHz, for a file without a time column.")] = "",
    time: Annotated[str, typer.Option(help="Name of the time column, if it is not recognised.")] = "",
    force: Annotated[str, typer.Option(help="Name of the force column, if it is not recognised.")] = "",
    channel_map: Annotated[Path | None, typer.Option("--map", help="Channel map, .toml, as for `log import`.")] = None,
    out: Annotated[
        list[Path],
        typer.Option(
            help="File to write, repeatable: .html page; .csv, .xlsx slips; .svg, .pdf, .png force with its slips; .toml map."
        ),
    ] = [],  # noqa: B006
    as_json: Json = None,
) -> None:
    """Estimate slips, period, F_s, F_k, mu, stiffness and mass from a measured file, each with its 90 % interval."""
    from cockpit.look.cycles import refuse_to_replace_sheet
    from cockpit.look.evidence import hints
    from cockpit.look.source import Looked, LookOptions, looked_at, read_record
    from diagnosis.look.words import headline, sentences

    check_file(path, "BAD_TABLE", "give the path of a file of measured data")
    for target in out:
        check_output("--out", target, _OUTPUTS)
        refuse_to_lose([path], "the measured file", "--out", target)
        if target.suffix.lower() in SHEETS:
            refuse_to_replace_sheet(target, f"--out {target}")
    asked = LookOptions(
        quantity("--speed", speed, "velocity"),
        quantity("--load", load, "force"),
        quantity("--mass", mass, "mass"),
        quantity("--rate", rate, "frequency"),
        time,
        force,
        channel_map,
        turns(speed) if speed else None,
    )
    record = read_record(path, asked)
    for target in (target for target in out if target.suffix.lower() in RIG):
        if not record.map_text:
            raise Fault(
                "CONFIG",
                f"--out {target}: no map to write: --map was given, or the file is a run log; leave it out",
            )
        refuse_to_replace_corrected(target, record.map_text, f"--out {target}")
    seen = looked_at(record)
    findings = [*record.findings, *hints(seen, {} if asked.mass_kg is None else {"mass_kg": asked.mass_kg})]
    for target in out:
        _write(target, seen, record, findings)
    lines = [
        headline(seen),
        *sentences(seen),
        *(finding.in_words() for finding in findings),
        *(f"written    {target}" for target in out),
    ]
    if record.map_text and not any(target.suffix == ".toml" for target in out):
        lines.append(
            "map        --out map.toml saves how the columns were read; correct that file and pass it with --map"
        )
    print_result(as_json, Looked(seen, findings, out), lines)


def _write(target: Path, seen: Any, record: Any, findings: list[Any]) -> None:
    suffix = target.suffix.lower()
    with writing(target):
        if suffix in PAGE:
            from cockpit.look.page import write_page

            write_page(seen, record.path, findings, target)
        elif suffix in PICTURE:
            from bridge.files import replacing
            from bridge.provenance import provenance
            from cockpit.look.page import save, whole

            with replacing(target) as file:
                save(whole(seen), file, suffix[1:], note=provenance([record.path]).in_words())
        elif suffix in RIG:
            from bridge.files import write_whole

            write_whole(target, record.map_text)
        else:
            from cockpit.look.cycles import write_cycles

            write_cycles(seen, target, record.path)
