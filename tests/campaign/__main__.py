"""Make cases, diagnose each, score: python -m tests.campaign --out DIR. What has a result already is not done again."""

import argparse
import json
import time
from pathlib import Path

from diagnosis.protocols import FORCE_PROTOCOL, PROTOCOLS
from tests.campaign.cases import plan
from tests.campaign.running import read, run
from tests.campaign.scoring import score
from tests.campaign.table import table

parser = argparse.ArgumentParser(prog="python -m tests.campaign", description=__doc__)
parser.add_argument("--out", type=Path, required=True, metavar="DIR")
parser.add_argument("--effects", default="", help="names with commas in between; all if left out")
parser.add_argument("--cases", type=int, default=20, help="of every effect")
parser.add_argument("--none", type=int, default=40, help="without any effect")
parser.add_argument("--pairs", type=int, default=20, help="with two effects")
parser.add_argument("--protocol", default="ladder", choices=[*PROTOCOLS, FORCE_PROTOCOL])
parser.add_argument("--jobs", type=int, default=2)
parser.add_argument("--seed", type=int, default=1)
parser.add_argument("--score-only", action="store_true", help="read the results that are there")
parser.add_argument("--json", type=Path, metavar="FILE", help="write the scores there, too")

if __name__ == "__main__":
    told = parser.parse_args()
    if not told.score_only:
        effects = [name for name in told.effects.split(",") if name]
        planned = plan(told.protocol, effects, told.cases, told.none, told.pairs, told.seed)
        told.out.mkdir(parents=True, exist_ok=True)
        begin_s = time.perf_counter()
        for done, (case, said) in enumerate(run(told.out, planned, told.jobs), 1):
            names = ", ".join(effect.name for effect in case.effects) or "none"
            each_s = (time.perf_counter() - begin_s) / done
            print(f"{done:5} {each_s:6.1f} s each  {case.folder}  {names}: {said}", flush=True)
    scores = score(read(told.out))
    print(table(scores))
    if told.json:
        told.json.write_text(json.dumps(scores, indent=1))
