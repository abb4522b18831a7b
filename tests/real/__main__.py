"""Diagnose the measured logs next to the repository and print the figures of docs/quality/results.md."""

import argparse
import json
import sys
import tempfile
from pathlib import Path

from bridge.results import strict_json
from diagnosis.diagnose import diagnose
from diagnosis.evidence.folder import load_evidence
from diagnosis.report.page import write_report
from diagnosis.threads import one_thread
from tests.real.evidences import AXIS, EVIDENCES, MISSING, SLIDER
from tests.real.known import known
from tests.real.table import lines, of_latent, of_relations

parser = argparse.ArgumentParser(prog="python -m tests.real", description=__doc__)
parser.add_argument("names", nargs="*", metavar="NAME", help=f"of {', '.join(EVIDENCES)}; all if left out")
parser.add_argument("--json", type=Path, metavar="FILE", help="write all results there")
parser.add_argument("--out", type=Path, default=Path("runs/real"), metavar="DIR", help="reports")
parser.add_argument("--known", action="store_true", help="only what plain rulers say, beforehand")
parser.add_argument(
    "--relations", action="store_true", help="only the relations between channels, without a simulation"
)
parser.add_argument("--latent", action="store_true", help="only what the friction goes with, without a simulation")
parser.add_argument("--jobs", type=int, default=1)
parser.add_argument("--budget", type=float, metavar="S", help="seconds after which an answer is what is known by then")

if __name__ == "__main__":
    arguments = parser.parse_args()
    if unknown := set(arguments.names) - EVIDENCES.keys():
        parser.error(f"{', '.join(sorted(unknown))}: no such evidence; known here: {', '.join(EVIDENCES)}")
    if not (SLIDER.is_dir() and AXIS.is_dir()):
        print(f"nothing done: {MISSING}")
        sys.exit()
    if arguments.known:
        print("\n".join(known()))
        sys.exit()
    if arguments.relations or arguments.latent:
        of_evidence = of_relations if arguments.relations else of_latent
        for name in arguments.names or EVIDENCES:
            with tempfile.TemporaryDirectory() as folder, one_thread():
                EVIDENCES[name](Path(folder))
                shown = of_evidence(load_evidence(Path(folder)))
                print("\n".join([name, *(f"  {line}" for line in shown)]), flush=True)
        sys.exit()
    arguments.out.mkdir(parents=True, exist_ok=True)
    results = {}
    for name in arguments.names or EVIDENCES:
        with tempfile.TemporaryDirectory() as folder:
            EVIDENCES[name](Path(folder))
            diagnosis = diagnose(
                load_evidence(Path(folder)),
                lambda text, _share, name=name: print(f"{name}: {text}", file=sys.stderr, flush=True),
                arguments.jobs,
                arguments.budget,
            )
        write_report(diagnosis, name, arguments.out / f"{name}.html")
        results[name] = strict_json(diagnosis)
        print("\n".join([name, *(f"  {line}" for line in lines(diagnosis))]), flush=True)
    if arguments.json:
        arguments.json.write_text(json.dumps(results, indent=1), encoding="utf-8")
