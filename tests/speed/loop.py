"""The loop in real time compared with plain ping-pongs of the same minutes, and lockstep with its limit."""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from tests.speed.ping_pong import CHANNEL, MEMORY, NAMES, PLAIN, SETTINGS, SOCKET, Nanoseconds, measure
from tests.speed.runs import FROM_THE_START, bar, result, start, timed

SECONDS, QUICK_SECONDS = 60.0, 10.0
PINGS, QUICK_PINGS = 5_000, 1_000  # a turn
LOCKSTEP_SECONDS, QUICK_LOCKSTEP_SECONDS = 16.0, 5.0
IN_PROCESS_SECONDS = 90.0  # the drive leaves its range later on


def _row(name: str, p50_us: float, p99_us: float, p999_us: float) -> None:
    print(f"  {name:<44} p50 {p50_us:6.0f} us   p99 {p99_us:6.0f} us   p99.9 {p999_us:6.0f} us")


def bench(quick: bool = False) -> bool:
    """Print the tables; whether every bar is kept."""
    with tempfile.TemporaryDirectory() as folder:
        log = Path(folder) / "run.mcap"
        p50_us = _real_time(log, QUICK_SECONDS if quick else SECONDS, QUICK_PINGS if quick else PINGS)
        seconds = QUICK_LOCKSTEP_SECONDS if quick else LOCKSTEP_SECONDS
        print(f"\nlockstep: {seconds:g} simulated s, log written")
        speed = seconds / timed([log], seconds, "--lockstep")[1][0]
        share = speed * p50_us[CHANNEL] * 1e-3
        kept = [
            p50_us["kept"] == 1.0,
            bar("over Zenoh [x real time]", speed, speed >= 5.0, "at least 5"),
            bar("over Zenoh, of the `recv` ping-pong [%]", 100 * share, share >= 0.9, "at least 90"),
        ]
        alone = IN_PROCESS_SECONDS / timed([log], IN_PROCESS_SECONDS, "--in-process")[1][0]
        kept.append(bar("in one process [x real time]", alone, alone >= 200.0, "at least 200"))
        return all(kept)


def _real_time(log: Path, seconds: float, pings: int) -> dict[str, float]:
    """Print the loop with ping-pongs before and after it; the medians [us] by kind, and under "kept" 1 for all bars kept."""
    print(
        f"\nreal time: {seconds:g} s at 1000 blocks/s, block out to command in, beside ping-pongs of the same minutes"
    )
    turns: dict[str, list[Nanoseconds]] = {kind: [measure(kind, pings)] for kind in NAMES}
    verdict = result(start(log, seconds, *FROM_THE_START))
    for kind in NAMES:
        turns[kind].append(measure(kind, pings))
    p50_us: dict[str, float] = {}
    for kind in (MEMORY, SOCKET, CHANNEL, SETTINGS, PLAIN):
        figures = [float(value) * 1e-3 for value in np.percentile(np.concatenate(turns[kind]), [50, 99, 99.9])]
        p50_us[kind] = figures[0]
        _row(NAMES[kind], *figures)
    latency: dict[str, float] = verdict["latency"]
    _row("the loop", latency["p50_us"], latency["p99_us"], latency["p999_us"])
    ratio = latency["p50_us"] / p50_us[PLAIN]
    kept = [
        bar(f"p50 over that of {NAMES[PLAIN]}", ratio, ratio <= 1.35, "at most 1.35"),
        *_on_time(verdict),
        bar("lost blocks", verdict["lost_blocks"], verdict["lost_blocks"] == 0, "0"),
    ]
    for kind in (SETTINGS, CHANNEL, SOCKET, MEMORY):
        print(f"  {f'p50 over that of {NAMES[kind]}':<44} {latency['p50_us'] / p50_us[kind]:8.2f}")
    print(f"  log messages lost {verdict['lost_messages']}")
    p50_us["kept"] = float(all(kept))
    return p50_us


def _on_time(verdict: dict[str, Any]) -> list[bool]:
    """Print which commands were late, and whether the computer stalled then."""
    print(f"  {'commands within 1 ms [%]':<44} {100 * verdict['latency']['within_1_ms']:8.3f}")
    pauses = verdict["pauses"]
    if pauses is None:
        print(f"  stalls of the computer were not watched: {verdict['not_watched']}; their bar is not judged")
        return []
    print(
        f"  the computer stalled {pauses['number']} times, {pauses['total_ms']:.1f} ms in all, the longest "
        f"{pauses['longest_ms']:.1f} ms; late commands: {pauses['late_inside']} in its pauses, {pauses['late_outside']} outside, "
        f"{pauses['late_one_core']} of these while one core stalled alone"
    )
    share = pauses["within_1_ms_outside"]
    return [bar("commands within 1 ms outside of pauses [%]", 100 * share, share >= 0.9999, "at least 99.99")]
