"""`stickslip diagnose`: the effect that makes a rig differ from its description; for one evidence folder or many."""

import sys
import threading
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from bridge.faults import FAULTS, Fault
from bridge.files import refuse_to_replace_text
from bridge.plain import plain, print_line
from cockpit.commands.as_json.option import STDOUT, Json, print_result
from cockpit.commands.options import Certs, command
from cockpit.run.child_process import end_like_ctrl_c, report
from cockpit.run.writable import JSON, PAGE, RIG, check_output, check_output_folder, written

if TYPE_CHECKING:
    from cockpit.commands.diagnose_output import Diagnoses
    from diagnosis.diagnose_many import EvidenceFolder
    from diagnosis.evidence.folder import Evidence
    from diagnosis.result import Diagnosis


class _Options(NamedTuple):
    """Options of the command line."""

    as_json: Path | None
    report: Path | None
    apply: Path | None
    jobs: int
    cluster: str
    certs: str
    budget_s: float | None
    all: bool

    @property
    def diagnose(self) -> Callable[["Evidence", Callable[[str, float], None], int], "Diagnosis"]:
        """The function that diagnoses a folder; it can be pickled for a worker."""
        from diagnosis.diagnose_many import real_diagnose

        return partial(real_diagnose, budget_s=self.budget_s)


@command()
def diagnose(
    evidence: Annotated[
        list[Path],
        typer.Argument(help="Evidence folders with a manifest.toml, a folder of such folders, or one measured file."),
    ],
    report: Annotated[
        Path | None,
        typer.Option(
            help="Report to write, one .html file; for several folders a folder of reports, whose results are reused."
        ),
    ] = None,
    apply: Annotated[Path | None, typer.Option(help="Rig file to write, .toml, with the diagnosed effect.")] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Number of cores to use; all if not given.")] = None,
    cluster: Annotated[
        str,
        typer.Option(
            help="Dask scheduler, e.g. tcp://127.0.0.1:8786 or tls://HOST:8786; its workers read the folders themselves."
        ),
    ] = "",
    certs: Certs = None,
    budget: Annotated[
        str, typer.Option(help="Time limit per folder, e.g. 30s; then the best answer so far. No limit if not given.")
    ] = "",
    speed: Annotated[str, typer.Option(help="Drive speed, for a single measured file, e.g. 0.5mm/s.")] = "",
    mass: Annotated[
        str,
        typer.Option(
            help="Mass of the slide, for a single measured file, e.g. 1.5kg; estimated from the slips if not given."
        ),
    ] = "",
    channel_map: Annotated[
        Path | None, typer.Option("--map", help="Channel map, .toml, for a single measured file.")
    ] = None,
    show_all: Annotated[
        bool, typer.Option("--all", help="Print every candidate, relation, share and number below the answer.")
    ] = False,
    as_json: Json = None,
) -> int:
    """Find the effect that makes a rig differ from its description: its probability, and how much of the gap it closes."""
    from joblib import cpu_count

    from cockpit.look.quantity import quantity
    from diagnosis.diagnose_many import find_sources
    from diagnosis.evidence.manifest import check_folder

    end_like_ctrl_c()
    budget_s = quantity("--budget", budget, "time")
    options = _Options(as_json, report, apply, jobs or cpu_count(), cluster, str(certs or ""), budget_s, show_all)
    if len(evidence) == 1 and evidence[0].is_file():
        return _diagnose_file(evidence[0], options, speed, mass, channel_map)
    sources = find_sources(evidence)
    is_single = all(path.resolve() == sources[0].folder for path in evidence)
    _check_destinations(options, is_single, sources)
    for path in evidence:  # checked before minutes of work on the other folders
        check_folder(path)
    return _diagnose_one(sources[0], options) if is_single else _diagnose_many(sources, options)


def _check_destinations(options: _Options, is_single: bool, sources: list["EvidenceFolder"]) -> None:
    """Refuse outputs that cannot be written, before minutes of work. Raises Fault CONFIG or LOG_WRITE."""
    if options.apply is not None and not is_single:
        raise Fault(
            "CONFIG", f"--apply {options.apply}: takes one evidence folder; a rig file has the effects of one rig"
        )
    from diagnosis.evidence.manifest import MANIFEST, RUN_SUFFIXES
    from diagnosis.report.rig_file import RIG_BEGINS

    seen: dict[Path, str] = {}
    json_file = None if options.as_json == STDOUT else options.as_json
    outputs = ("--json", json_file, JSON), ("--report", options.report, PAGE), ("--apply", options.apply, RIG)
    for option, path, kinds in outputs:
        if path is None:
            continue
        if path == STDOUT:
            raise Fault("CONFIG", f"{option} -: must be a file; only --json can go to stdout")
        if option == "--report" and not is_single:
            check_output_folder(option, path)
        else:
            check_output(option, path, kinds)
        if kinds == RIG:
            refuse_to_replace_text(path, RIG_BEGINS, f"{option} {path}")
        file = path.resolve()
        if file in seen:
            raise Fault("CONFIG", f"{option} {path}: is also the file of {seen[file]}; choose another")
        seen[file] = option
        measured = file.name == MANIFEST or file.suffix in RUN_SUFFIXES
        if measured and file.exists() and file.parent in {source.folder.resolve() for source in sources}:
            raise Fault(
                "CONFIG", f"{option} {path}: belongs to the evidence, which is never overwritten; choose another"
            )


def _diagnose_file(path: Path, options: _Options, speed: str, mass: str, channel_map: Path | None) -> int:
    """Diagnose a measured file. The numbers of the rig are estimated from the file and printed before the diagnosis."""
    from tempfile import TemporaryDirectory

    from cockpit.look.evidence import write_evidence
    from cockpit.look.quantity import quantity
    from cockpit.look.source import LookOptions, looked_at, read_record
    from diagnosis.diagnose_many import EvidenceFolder
    from diagnosis.look.words import headline

    if options.cluster:
        raise Fault("CONFIG", f"--cluster: takes evidence folders, which its workers read themselves; {path} is a file")
    _check_destinations(options, is_single=True, sources=[])
    asked = LookOptions(quantity("--speed", speed, "velocity"), None, quantity("--mass", mass, "mass"), map=channel_map)
    record = read_record(path, asked)
    seen = looked_at(record)
    with TemporaryDirectory(prefix="stickslip-") as folder:
        rig, assumed = write_evidence(record, seen, Path(folder))
        _print_line(options, headline(seen))
        for name, value in rig.values().items():
            share = rig.tolerance.get(name, 0.0)
            given = (
                "given"
                if name == "mass_kg" and mass
                else "described in the log"
                if name in record.rig
                else "from the file"
            )
            how = "assumed" if name in assumed else given
            _print_line(
                options,
                f"rig        {name} = {value:.6g}" + (f" +- {100.0 * share:.2g} %" if share else "") + f", {how}",
            )
        for finding in record.findings:
            _print_line(options, finding.in_words())
        return _diagnose_one(EvidenceFolder(path.stem, Path(folder)), options)


def _diagnose_one(source: "EvidenceFolder", options: _Options) -> int:
    from cockpit.commands.diagnose_output import details, watched
    from cockpit.fleet.work import write_source_report
    from diagnosis.deadline import forecast
    from diagnosis.evidence.folder import load_evidence
    from diagnosis.report.rig_file import NO_RIG, refuse_force_drive, write_rig
    from diagnosis.report.words import to_correct

    evidence = load_evidence(source.folder)
    if options.apply is not None:
        refuse_force_drive(evidence)
    with watched() as progress:
        for finding in to_correct(evidence.findings):
            progress(f"correct first: {finding.where}: {finding.text}", 0.0)
        fitted_s = sum(float(run.t_s[-1] - run.t_s[0]) for run in evidence.runs if not run.holdout)
        limit = "" if options.budget_s is None else f", {options.budget_s:g} s at most"
        progress(f"the simulated fits of {fitted_s:.0f} s take about {forecast(fitted_s, options.jobs)}{limit}", 0.0)
        pressed = threading.Event()
        diagnosis = _result(source, evidence, options, progress, pressed)
    refused: list[Fault] = []
    _print(options, diagnosis, [*diagnosis.summary, *(details(diagnosis) if options.all else ())], refused)
    wanted: list[tuple[str, Path | None, Callable[[Path], None]]] = [
        ("report     ", options.report, partial(write_source_report, source, diagnosis))
    ]
    if options.apply is not None and (why := NO_RIG.get(diagnosis.verdict)):
        _print_line(options, f"rig file   not written: {why}, so no effect can be applied")
    else:
        wanted.append(("rig file   ", options.apply, lambda path: write_rig(diagnosis, evidence, path)))
    for label, path, write in wanted:
        if path is not None and written(partial(write, path), refused):
            _print_line(options, f"{label}{path}")
    return _report_refused(refused) or (FAULTS["INTERRUPTED"].exit_status if pressed.is_set() else 0)


def _print(options: _Options, result: "Diagnosis | Diagnoses", words: list[str], refused: list[Fault]) -> None:
    """Print a result. A JSON file that cannot be written does not prevent the other files."""
    try:
        print_result(options.as_json, result, words, indent=1)
    except Fault as fault:
        refused.append(fault)


def _report_refused(refused: list[Fault]) -> int:
    """Report the files that could not be written; the exit status. On stderr, as stdout may hold the JSON."""
    if not refused:
        return 0
    return report(Fault("LOG_WRITE", "\n".join(fault.line for fault in refused)), as_json=False)


def _print_line(options: _Options, line: str) -> None:
    """Print a line on stdout, or on stderr if the JSON goes to stdout."""
    print(plain(line), file=sys.stderr if options.as_json == STDOUT else sys.stdout)


def _result(
    source: "EvidenceFolder",
    evidence: "Evidence",
    options: _Options,
    progress: Callable[[str, float], None],
    pressed: threading.Event,
) -> "Diagnosis":
    from joblib import parallel_config

    from diagnosis import diagnose_many as many
    from diagnosis.deadline import ended_by_ctrl_c

    if not options.cluster:
        workers = parallel_config(backend="loky", initializer=many.leave_interrupt_to_parent)
        with workers, ended_by_ctrl_c(pressed):
            return options.diagnose(evidence, progress, options.jobs)
    with closing(many.diagnose_many([source], 1, options.cluster, options.diagnose, options.certs)) as outcomes:
        outcome = next(outcomes)
    if outcome.diagnosis is None:
        raise Fault(*(outcome.fault or ("PEER_DIED", "")))
    return outcome.diagnosis


def _diagnose_many(sources: list["EvidenceFolder"], options: _Options) -> int:
    """Diagnose all folders; with --report the results already in its folder are reused."""
    from cockpit.commands.diagnose_output import Diagnoses, in_a_line, watched
    from cockpit.fleet.work import INDEX, FleetFolder, without_pictures
    from diagnosis import diagnose_many as many

    fleet = None if options.report is None else FleetFolder(options.report, sources, options.budget_s)
    outcomes_by_name = {outcome.source.name: outcome for outcome in (fleet.kept() if fleet else [])}
    missing = [source for source in sources if source.name not in outcomes_by_name]
    if outcomes_by_name:
        print_line(
            f"{len(outcomes_by_name)} of {len(sources)} reused from {options.report}: the same files, the same version"
        )
    try:
        with (
            watched() as progress,
            closing(
                many.diagnose_many(missing, options.jobs, options.cluster, options.diagnose, options.certs)
            ) as outcomes,
        ):
            for outcome in outcomes:
                outcomes_by_name[outcome.source.name] = without_pictures(outcome)
                if fleet is not None:
                    fleet.add(outcome)
                line = f"{len(outcomes_by_name)} of {len(sources)}: {in_a_line(outcome)}"
                progress(line, len(outcomes_by_name) / len(sources))
    except KeyboardInterrupt:
        if fleet is not None:
            print_line(
                f"{len(outcomes_by_name)} of {len(sources)} are in {options.report}; run the same command again to continue"
            )
        raise
    results = [outcomes_by_name[source.name] for source in sources]
    refused = [] if fleet is None else fleet.refused
    table = Diagnoses(results)
    words = [in_a_line(outcome) for outcome in results]
    if options.report is not None:
        words.append(f"reports    {options.report / INDEX}")
    _print(options, table, words, refused)
    statuses = [FAULTS[outcome.fault.fault].exit_status for outcome in results if outcome.fault is not None]
    # of several statuses the lowest: bad evidence comes first, which the caller can mend
    return min((status for status in (*statuses, _report_refused(refused)) if status), default=0)
