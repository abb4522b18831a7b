"""Several rigs on one machine: in real time, and in lockstep."""

import tempfile
from pathlib import Path
from typing import Any

from tests.speed.runs import FROM_THE_START, bar, result, start, timed

RIGS, QUICK_RIGS = (1, 2, 4), (2,)
SECONDS, QUICK_SECONDS = 11.0, 5.0
LOCKSTEP_SECONDS, QUICK_LOCKSTEP_SECONDS = 8.0, 4.0


def bench(quick: bool = False) -> bool:
    """Print the tables; whether every bar is kept."""
    with tempfile.TemporaryDirectory() as folder:
        seconds = QUICK_SECONDS if quick else SECONDS
        print(f"\nrigs side by side in real time, {seconds:g} s, plant, controller and recorder each")
        kept = [_real_time(Path(folder), rigs, seconds) for rigs in (QUICK_RIGS if quick else RIGS)]
        kept.append(_lockstep(Path(folder), QUICK_LOCKSTEP_SECONDS if quick else LOCKSTEP_SECONDS))
        return all(kept)


def _real_time(folder: Path, rigs: int, seconds: float) -> bool:
    """Print how many rigs fare; whether none died, and of up to two none lost a block."""
    runs = [start(folder / f"{rig}.mcap", seconds, *FROM_THE_START) for rig in range(rigs)]
    results = [result(run) for run in runs]
    alive = [found for found in results if "fault" not in found]
    dead = [f"{found['fault']}: {found['line']}" for found in results if "fault" in found]
    answered = [found for found in alive if found["latency"] is not None]
    lost = sum(found["lost_blocks"] for found in alive)
    good = not dead and (rigs > 2 or lost == 0)
    print(f"  {rigs} of them: lost blocks {lost}, died {len(dead)}; {_times(answered)}; {'PASS' if good else 'FAIL'}")
    for line in dead:
        print(f"    {line}")
    return good


def _times(results: list[dict[str, Any]]) -> str:
    """Medians and shares of the slowest and the fastest rig."""
    if not results:
        return "no command was timed"
    p50_us = [found["latency"]["p50_us"] for found in results]
    within = [100 * found["latency"]["within_1_ms"] for found in results]
    words = f"p50 {min(p50_us):.0f} to {max(p50_us):.0f} us, within 1 ms {min(within):.2f} to {max(within):.2f} %"
    outside = [100 * found["pauses"]["within_1_ms_outside"] for found in results if found["pauses"] is not None]
    return words + (f", outside of pauses {min(outside):.2f} to {max(outside):.2f} %" if outside else "")


def _lockstep(folder: Path, seconds: float) -> bool:
    """Print the speed of two simultaneous runs in lockstep; whether each wrote the same as alone."""
    alone, both = folder / "alone.mcap", [folder / "first.mcap", folder / "second.mcap"]
    (alone_s,) = timed([alone], seconds, "--lockstep")[1]
    results, both_s = timed(both, seconds, "--lockstep")
    lost = sum(found["lost_messages"] for found in results)
    same = lost == 0 and all(_streams(log) == _streams(alone) for log in both)
    print(f"\nlockstep side by side, {seconds:g} simulated s, log written")
    print(
        f"  alone {seconds / alone_s:.2f} times real time, of two {seconds / max(both_s):.2f} and {seconds / min(both_s):.2f}"
    )
    return bar("messages lost or other than alone", float(not same), same, "0")


def _streams(log: Path) -> list[bytes]:
    """Every message of the streaming topics."""
    from bridge.log.logfile import STREAMING, read_run

    run = read_run(log)
    return [getattr(run, name).tobytes() for name in STREAMING]
