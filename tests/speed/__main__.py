"""Run every bench, one after the other so that none slows another; exit 1 if one misses its bar.

`--quick`: fewer repetitions, shorter runs, and no part of some minutes.
"""

import sys
import time

from tests.speed import cycles, diagnosis, effects, files, kernel, loop, old_version, replay, rig, side_by_side

# the diagnosis first: its memory counts this process too, with the rest of the others in it
BENCHES = [
    diagnosis.bench,
    kernel.bench,
    effects.bench,
    old_version.bench,
    loop.bench,
    side_by_side.bench,
    rig.bench,
    replay.bench,
    files.bench,
    cycles.bench,
]

began_s = time.perf_counter()
kept = [bench("--quick" in sys.argv[1:]) for bench in BENCHES]
print(f"\n{sum(kept)} of {len(kept)} parts keep all of their bars; {(time.perf_counter() - began_s) / 60:.1f} min")
sys.exit(0 if all(kept) else 1)
