"""`stickslip look`: estimates from a measured file."""

from pathlib import Path
from typing import Annotated, Any

import typer

from bridge.faults import Fault
from bridge.files import check_file, refuse_to_lose, refuse_to_replace_corrected
from cockpit.commands.as_json.option import Json, print_result
from cockpit.commands.options import FILE, FileOptions, command
from cockpit.run.writable import PAGE, PICTURE, RIG, SHEETS, check_output, writing

_OUTPUTS = (*PAGE, *SHEETS, *PICTURE, *RIG)


@command(*FILE)
def look(
    options: FileOptions,
    path: Annotated[
        Path, typer.Argument(metavar="FILE", help="Measured data in any format of `log import`, or a run log.")
    ],
    out: Annotated[
        list[Path],
        typer.Option(
            help="File to write, repeatable: .html page; .csv, .xlsx slips; .svg, .pdf, .png force with its slips; .toml map."
        ),
    ] = [],  # noqa: B006
    why: Annotated[bool, typer.Option("--why", help="Print how each column was recognised too.")] = False,
    as_json: Json = None,
) -> None:
    """Estimate slips, period, F_s, F_k, mu, stiffness and mass from a measured file, each with its 90 % interval."""
    from bridge.tables.kinds import kind_of

    check_file(path, "BAD_TABLE", "give the path of a file of measured data")
    kind_of(path)  # refuses other files before the libraries for tables are imported
    from cockpit.look.cycles import refuse_to_replace_sheet
    from cockpit.look.doubts import refuse_absurd
    from cockpit.look.evidence import hints
    from cockpit.look.pieces import looked, of_pieces_in_words
    from cockpit.look.source import looked_at, read_record
    from diagnosis.look.words import headline, sentences

    for target in out:
        check_output("--out", target, _OUTPUTS)
        refuse_to_lose([path], "the measured file", "--out", target)
        if target.suffix.lower() in SHEETS:
            refuse_to_replace_sheet(target, f"--out {target}")
    asked = options.asked()
    record = read_record(path, asked)
    for target in (target for target in out if target.suffix.lower() in RIG):
        if not record.map_text:
            raise Fault(
                "CONFIG",
                f"--out {target}: no map to write: --map was given, or the file is a run log or holds no force; leave it out",
            )
        refuse_to_replace_corrected(target, record.map_text, f"--out {target}")
    seen = looked_at(record)
    refuse_absurd(seen, path.name, record.counts)
    findings = [*record.findings, *hints(seen, {} if asked.mass_kg is None else {"mass_kg": asked.mass_kg})]
    result = looked(record, seen, findings, out)
    for target in out:
        _write(target, result, record)
    lines = [
        headline(seen),
        *sentences(seen),
        *of_pieces_in_words(result),
        *(finding.in_words() for finding in findings if why or finding.kind != "assumed"),
        *(f"written    {target}" for target in out),
    ]
    if record.map_text and not any(target.suffix == ".toml" for target in out):
        lines.append(
            "map        --out map.toml saves how the columns were read, --why prints it; correct that file and pass it with --map"
        )
    print_result(as_json, result, lines)


def _write(target: Path, result: Any, record: Any) -> None:
    suffix = target.suffix.lower()
    with writing(target):
        if suffix in PAGE:
            from cockpit.look.page import write_page

            write_page(result, record.path, target)
        elif suffix in PICTURE:
            from bridge.files import replacing
            from bridge.provenance import provenance
            from cockpit.look.page import save, whole

            with replacing(target) as file:
                save(whole(result.seen), file, suffix[1:], note=provenance([record.path]).in_words())
        elif suffix in RIG:
            from bridge.files import write_whole

            write_whole(target, record.map_text)
        else:
            from cockpit.look.cycles import write_cycles

            write_cycles(result.seen, target, record.path)
