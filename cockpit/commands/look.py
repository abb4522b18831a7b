"""`stickslip look`: what is in a measured file, at a glance."""

from pathlib import Path
from typing import Annotated, Any

import typer

from bridge.faults import Fault
from bridge.files import check_file, refuse_to_lose, refuse_to_replace_corrected
from cockpit.commands.as_json.option import Json, carry_out, tell
from cockpit.look.quantity import quantity, turns
from cockpit.run.writable import PAGE, PICTURE, RIG, SHEETS, check_output, writing

_OUTPUTS = (*PAGE, *SHEETS, *PICTURE, *RIG)


def look(
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="Measured data of any kind that log import reads, or a run log.")
    ],
    speed: Annotated[str, typer.Option(help="Of the drive, e.g. 0.5mm/s; for stiffness and mass.")] = "",
    load: Annotated[str, typer.Option(help="Normal load, e.g. 94.5N; for friction coefficients.")] = "",
    mass: Annotated[str, typer.Option(help="Of the slide, e.g. 1.5kg; compared with the one that is seen.")] = "",
    rate: Annotated[str, typer.Option(help="Of the samples, e.g. 1kHz, where the file has no time.")] = "",
    time: Annotated[str, typer.Option(help="Column of the time, where it is not found.")] = "",
    force: Annotated[str, typer.Option(help="Column of the force, where it is not found.")] = "",
    channel_map: Annotated[
        Path | None, typer.Option("--map", help="Channel map, .toml, as log import takes it.")
    ] = None,
    out: Annotated[
        list[Path],
        typer.Option(
            help="Repeatable: .html a page, .csv or .xlsx the slips, .svg, .pdf or .png the force with its slips, .toml the map."
        ),
    ] = [],  # noqa: B006
    as_json: Json = None,
) -> None:
    """Say what is in a measured file: slips, period, F_s, F_k, mu, stiffness, mass, each with its 90 % interval."""

    def work() -> None:
        from cockpit.look.cycles import refuse_to_replace_sheet
        from cockpit.look.source import Asked, read_record
        from diagnosis.look.look import look as look_at
        from diagnosis.look.words import headline, sentences

        check_file(path, "BAD_TABLE", "give the path of a file of measured data")
        for one in out:
            check_output("--out", one, _OUTPUTS)
            refuse_to_lose([path], "the measured file", "--out", one)
            if one.suffix.lower() in SHEETS:
                refuse_to_replace_sheet(one, f"--out {one}")
        asked = Asked(
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
        for one in (one for one in out if one.suffix.lower() in RIG):
            if not record.map_text:
                raise Fault("CONFIG", f"--out {one}: there is no map to write: one was given, or the file is a run log")
            refuse_to_replace_corrected(one, record.map_text, f"--out {one}")
        seen = look_at(record.t_s, record.force_N, record.position_m, record.known)
        if seen is None:
            raise Fault("BAD_TABLE", f"{path.name}: fewer than 16 samples of a force with a time; give a longer record")
        findings = [*record.findings, *_hints(seen, asked.mass_kg)]
        written = [str(one) for one in out if _write(one, seen, record, findings)]
        lines = [
            headline(seen),
            *sentences(seen),
            *(one.in_words() for one in findings),
            *(f"written    {one}" for one in written),
        ]
        if record.map_text and not any(one.suffix == ".toml" for one in out):
            lines.append(
                "map        add --out map.toml to keep how the file was read, correct it, and give it to --map"
            )
        table: dict[str, Any] = {"headline": headline(seen)} | seen.as_dict()
        tell(as_json, table | {"findings": [one.as_dict() for one in findings], "written": written}, lines)

    carry_out(work, as_json)


def _hints(seen: Any, mass_kg: float | None) -> list[Any]:
    from cockpit.look.hints import hints

    return hints(seen, {} if mass_kg is None else {"mass_kg": mass_kg})


def _write(one: Path, seen: Any, record: Any, findings: list[Any]) -> bool:
    suffix = one.suffix.lower()
    with writing(one):
        one.parent.mkdir(parents=True, exist_ok=True)
        if suffix in PAGE:
            from cockpit.look.page import write_page

            write_page(seen, record.path, findings, one)
        elif suffix in PICTURE:
            from bridge.files import replacing
            from bridge.provenance import provenance
            from cockpit.look.plots import save, whole

            with replacing(one) as file:
                save(whole(seen), file, suffix[1:], note=provenance([record.path]).in_words())
        elif suffix in RIG:
            from bridge.files import write_whole

            write_whole(one, record.map_text)
        else:
            from cockpit.look.cycles import write_cycles

            write_cycles(seen, one, record.path)
    return True
