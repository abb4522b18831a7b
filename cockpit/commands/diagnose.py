"""`stickslip diagnose`: what makes a rig differ from its description; for one evidence folder or for many."""

import sys
from collections.abc import Callable
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, NamedTuple

import typer

from bridge.faults import FAULTS, Fault
from bridge.files import refuse_to_replace_text, write_json
from bridge.plain import plain, say
from cockpit.commands.as_json.option import STDOUT, Json, carry_out, tell
from cockpit.commands.options import Certs
from cockpit.run.child_process import end_like_ctrl_c, report
from cockpit.run.writable import JSON, PAGE, RIG, check_output, check_output_folder, writing

if TYPE_CHECKING:
    from diagnosis.diagnose_many import EvidenceFolder
    from diagnosis.evidence.folder import Evidence
    from diagnosis.result import Diagnosis


class _Wishes(NamedTuple):
    """What the command line asks for."""

    as_json: Path | None
    report: Path | None
    apply: Path | None
    jobs: int
    cluster: str
    certs: str
    budget_s: float | None

    @property
    def way(self) -> Callable[["Evidence", Callable[[str, float], None], int], "Diagnosis"]:
        """How a folder is diagnosed; it can be sent to a worker."""
        from diagnosis.diagnose_many import real_diagnose

        return partial(real_diagnose, budget_s=self.budget_s)

    @property
    def json_file(self) -> Path | None:
        """Where the JSON goes, if not to stdout."""
        return None if self.as_json == STDOUT else self.as_json

    @property
    def only_json(self) -> Path | None:
        """For `tell`: words, but for JSON on stdout; a file may be refused, and the words are said all the same."""
        return STDOUT if self.as_json == STDOUT else None


def diagnose(
    evidence: Annotated[
        list[Path],
        typer.Argument(
            help="Evidence folders with a manifest.toml, a folder that holds such folders, or one measured file."
        ),
    ],
    report: Annotated[
        Path | None,
        typer.Option(
            help="Write a report, one .html file; for many folders a folder of them with an index, in which each result is kept."
        ),
    ] = None,
    apply: Annotated[
        Path | None, typer.Option(help="Write a rig file, .toml, that has the effect that was found.")
    ] = None,
    jobs: Annotated[int | None, typer.Option(min=1, help="Processes to use; all cores if not given.")] = None,
    cluster: Annotated[
        str,
        typer.Option(
            help="Dask scheduler, e.g. tcp://127.0.0.1:8786, or tls://HOST:8786; its workers read the folders themselves."
        ),
    ] = "",
    certs: Certs = None,
    budget: Annotated[
        str, typer.Option(help="Time for a folder, e.g. 30s; then the best answer so far. No limit if not given.")
    ] = "",
    speed: Annotated[str, typer.Option(help="Of a file: speed of its drive, e.g. 0.5mm/s.")] = "",
    mass: Annotated[
        str, typer.Option(help="Of a file: mass of the slide, e.g. 1.5kg; seen in the slips if not given.")
    ] = "",
    channel_map: Annotated[Path | None, typer.Option("--map", help="Of a file: channel map, .toml.")] = None,
    as_json: Json = None,
) -> None:
    """Say what makes a rig differ from its description: the effect, how sure, how much of the gap it closes."""

    def work() -> int:
        from joblib import cpu_count

        from cockpit.look.quantity import quantity
        from diagnosis.diagnose_many import find_sources
        from diagnosis.evidence.manifest import check_folder

        end_like_ctrl_c()
        budget_s = quantity("--budget", budget, "time")
        wishes = _Wishes(as_json, report, apply, jobs or cpu_count(), cluster, str(certs or ""), budget_s)
        if len(evidence) == 1 and evidence[0].is_file():
            return _diagnose_file(evidence[0], wishes, speed, mass, channel_map)
        sources = find_sources(evidence)
        one = all(path.resolve() == sources[0].folder for path in evidence)
        _check_destinations(wishes, one, sources)
        for path in evidence:  # before minutes of work on the others
            check_folder(path)
        return _diagnose_one(sources[0], wishes) if one else _diagnose_many(sources, wishes)

    carry_out(work, as_json)


def _check_destinations(wishes: _Wishes, one: bool, sources: list["EvidenceFolder"]) -> None:
    """Refuse now what could not be written after minutes of work. Raises Fault CONFIG or LOG_WRITE."""
    if wishes.apply is not None and not one:
        raise Fault(
            "CONFIG", f"--apply {wishes.apply}: takes one evidence folder; a rig file has the effects of one rig"
        )
    from diagnosis.evidence.manifest import MANIFEST, RUN_SUFFIXES
    from diagnosis.report.rig_file import RIG_BEGINS

    seen: dict[Path, str] = {}
    asked = (("--json", wishes.json_file, JSON), ("--report", wishes.report, PAGE), ("--apply", wishes.apply, RIG))
    for option, path, kinds in asked:
        if path is None:
            continue
        if path == STDOUT:
            raise Fault("CONFIG", f"{option} -: must be a file; only --json can go to stdout")
        if option == "--report" and not one:
            check_output_folder(option, path)
        else:
            check_output(option, path, kinds)
        if kinds == RIG:
            refuse_to_replace_text(path, RIG_BEGINS, f"{option} {path}")
        whole = path.resolve()
        if whole in seen:
            raise Fault("CONFIG", f"{option} {path}: is where {seen[whole]} goes; choose another")
        seen[whole] = option
        measured = whole.name == MANIFEST or whole.suffix in RUN_SUFFIXES
        if measured and whole.exists() and whole.parent in {source.folder.resolve() for source in sources}:
            raise Fault(
                "CONFIG", f"{option} {path}: belongs to the evidence, which is never overwritten; choose another"
            )


def _diagnose_file(path: Path, wishes: _Wishes, speed: str, mass: str, channel_map: Path | None) -> int:
    """A measured file: its rig's numbers are those that it shows, and are told beside the refitted ones."""
    from tempfile import TemporaryDirectory

    from cockpit.look.evidence import write_evidence
    from cockpit.look.quantity import quantity
    from cockpit.look.source import Asked, read_record
    from diagnosis.diagnose_many import EvidenceFolder
    from diagnosis.look.look import look
    from diagnosis.look.words import headline

    if wishes.cluster:
        raise Fault("CONFIG", f"--cluster: takes evidence folders, which its workers read themselves; {path} is a file")
    _check_destinations(wishes, one=True, sources=[])
    asked = Asked(quantity("--speed", speed, "velocity"), None, quantity("--mass", mass, "mass"), map=channel_map)
    record = read_record(path, asked)
    seen = look(record.t_s, record.force_N, record.position_m, record.known)
    if seen is None:
        raise Fault("BAD_TABLE", f"{path.name}: fewer than 16 samples of a force with a time; give a longer record")
    with TemporaryDirectory(prefix="stickslip-") as folder:
        rig, assumed = write_evidence(record, seen, Path(folder))
        _tell(wishes, headline(seen))
        for name, value in rig.values().items():
            share = rig.tolerance.get(name, 0.0)
            how = "assumed" if name in assumed else "from the file" if name != "mass_kg" or not mass else "given"
            _tell(
                wishes,
                f"rig        {name} = {value:.6g}" + (f" +- {100.0 * share:.2g} %" if share else "") + f", {how}",
            )
        for finding in record.findings:
            _tell(wishes, finding.in_words())
        return _diagnose_one(EvidenceFolder(path.stem, Path(folder)), wishes)


def _diagnose_one(source: "EvidenceFolder", wishes: _Wishes) -> int:
    from cockpit.commands.diagnose_output import in_words, watched
    from diagnosis.evidence.folder import load_evidence
    from diagnosis.report.rig_file import refuse_force_drive, write_rig
    from diagnosis.result import to_json

    evidence = load_evidence(source.folder)
    if wishes.apply is not None:
        refuse_force_drive(evidence)
    with watched() as progress:
        diagnosis = _result(source, evidence, wishes, progress)
    tell(wishes.only_json, to_json(diagnosis), in_words(diagnosis), indent=1)
    wanted: list[tuple[str, Path | None, Callable[[Path], None]]] = [
        ("", wishes.json_file, lambda path: write_json(path, to_json(diagnosis))),
        ("report     ", wishes.report, partial(_write_report, source, diagnosis)),
    ]
    if wishes.apply is not None and diagnosis.verdict in ("unexplained", "partly"):
        why = (
            "nothing explains the gap" if diagnosis.verdict == "unexplained" else "only a part of the gap is explained"
        )
        _tell(wishes, f"rig file   not written: {why}, there is no effect to apply")
    else:
        wanted.append(("rig file   ", wishes.apply, lambda path: write_rig(diagnosis, evidence, path)))
    refused: list[Fault] = []
    for word, path, write in wanted:
        if path is not None and _written(path, write, refused) and word:
            _tell(wishes, f"{word}{path}")
    return _told(refused)


def _written(path: Path, write: Callable[[Path], None], refused: list[Fault]) -> bool:
    """Whether it was; else one more of `refused`: what one disk refuses the others may still get."""
    try:
        with writing():
            write(path)
    except Fault as fault:
        refused.append(fault)
        return False
    return True


def _told(refused: list[Fault]) -> int:
    """Exit status of all that could not be written. On stderr: stdout may have the JSON, which was."""
    if not refused:
        return 0
    return report(Fault("LOG_WRITE", "\n".join(fault.line for fault in refused)), as_json=False)


def _tell(wishes: _Wishes, line: str) -> None:
    """On stdout, but where the JSON goes there."""
    print(plain(line), file=sys.stderr if wishes.as_json == STDOUT else sys.stdout)


def _result(
    source: "EvidenceFolder", evidence: "Evidence", wishes: _Wishes, progress: Callable[[str, float], None]
) -> "Diagnosis":
    from diagnosis import diagnose_many as many

    if not wishes.cluster:
        return wishes.way(evidence, progress, wishes.jobs)
    with closing(many.diagnose_many([source], 1, wishes.cluster, wishes.way, wishes.certs)) as outcomes:
        outcome = next(outcomes)
    if outcome.diagnosis is None:
        raise Fault(*(outcome.fault or ("PEER_DIED", "")))
    return outcome.diagnosis


def _write_report(source: "EvidenceFolder", diagnosis: "Diagnosis", path: Path) -> None:
    """Write the report, with the files of the evidence at its foot. Raises Fault BAD_EVIDENCE, OSError."""
    from cockpit.fleet.kept import evidence_files
    from diagnosis.report.page import write_report

    write_report(diagnosis, source.name, path, evidence_files(source.folder))


def _diagnose_many(sources: list["EvidenceFolder"], wishes: _Wishes) -> int:
    """All folders; with --report what is kept there from before is not done again."""
    from cockpit.commands.diagnose_output import in_a_line, many_as_json, watched
    from cockpit.fleet.work import INDEX, FleetFolder, with_estimate, without_pictures
    from diagnosis import diagnose_many as many

    fleet = None if wishes.report is None else FleetFolder(wishes.report, sources, wishes.budget_s)
    found = {outcome.source.name: outcome for outcome in (fleet.kept() if fleet else [])}
    missing = [source for source in sources if source.name not in found]
    if found:
        say(f"{len(found)} of {len(sources)} are kept from before: the same files, the same version")
    try:
        with (
            watched() as progress,
            closing(many.diagnose_many(missing, wishes.jobs, wishes.cluster, wishes.way, wishes.certs)) as outcomes,
        ):
            for outcome, estimate in with_estimate(outcomes, len(missing)):
                found[outcome.source.name] = without_pictures(outcome)
                if fleet is not None:
                    fleet.add(outcome)
                told = f"{len(found)} of {len(sources)}: {in_a_line(outcome)}{estimate and f'; {estimate}'}"
                progress(told, len(found) / len(sources))
    except KeyboardInterrupt:
        if fleet is not None:
            say(f"{len(found)} of {len(sources)} are in {wishes.report}; the same command goes on from there")
        raise
    results = [found[source.name] for source in sources]
    refused = [] if fleet is None else fleet.refused
    table = many_as_json(results)
    if wishes.json_file is not None:
        _written(wishes.json_file, lambda path: write_json(path, table), refused)
    words = [in_a_line(outcome) for outcome in results]
    if wishes.report is not None:
        words.append(f"reports    {wishes.report / INDEX}")
    tell(wishes.only_json, table, words, indent=1)
    statuses = [FAULTS[outcome.fault[0]].exit_status for outcome in results if outcome.fault is not None]
    # bad evidence first: that is what the person who called can mend
    return min((status for status in (*statuses, _told(refused)) if status), default=0)
