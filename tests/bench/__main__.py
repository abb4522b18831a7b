"""Run every bench, one after the other so that none slows another; exit 1 if one misses its bar."""

import sys

from tests.bench import cycles, diagnosis, effects, kernel, loop, replay

# the diagnosis first: its memory counts this process too, and what the others leave in it
BENCHES = [diagnosis.bench, kernel.bench, effects.bench, loop.bench, replay.bench, cycles.bench]

kept = [bench() for bench in BENCHES]
sys.exit(0 if all(kept) else 1)
