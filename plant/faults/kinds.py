"""Every kind of fault by name: its targets, the meaning of its value, and its default."""

import math
from typing import NamedTuple

from bridge.wire.channels import CHANNELS

SENSORS, EXCITER, CLOCK, BUS, PROCESS = "sensors", "exciter", "clock", "bus", "process"
ALL_SENSORS = "sensors"
LINK = "link"  # both directions
LARGEST = 3.4e38  # largest sample on the wire, a 32-bit float
# targets by group
TARGETS = {
    SENSORS: (*CHANNELS, ALL_SENSORS),
    EXCITER: ("exciter",),
    CLOCK: ("clock",),
    BUS: ("blocks", "commands", LINK),
    PROCESS: ("controller", "plant", "recorder"),
}


class InjectionKind(NamedTuple):
    """One kind of fault."""

    group: str
    kind: str
    help: str
    value: str = ""  # meaning of the value, with its unit; empty for a kind without value
    default: float | None = None  # None for a kind without value, or if it must be given
    lowest: float = -math.inf  # limits of the value
    highest: float = math.inf


def _at_least_0(
    group: str, kind: str, text: str, value: str, default: float | None, highest: float = math.inf
) -> InjectionKind:
    return InjectionKind(group, kind, text, value, default, 0.0, highest)


ALL = (
    InjectionKind(
        SENSORS, "off", "reads a constant level: unplugged, or without supply", "level, in the unit of the channel", 0.0
    ),
    InjectionKind(SENSORS, "stuck", "holds the sample before the fault"),
    InjectionKind(SENSORS, "frozen", "repeats the block before the fault"),
    _at_least_0(
        SENSORS, "garbage", "random samples between plus and minus the value", "in the unit of the channel", None
    ),
    InjectionKind(SENSORS, "scaled", "a wrong gain or unit; below 0: a wrong sign", "factor", None),
    InjectionKind(SENSORS, "offset", "a constant offset", "in the unit of the channel", None),
    _at_least_0(SENSORS, "delayed", "delayed against the other channels", "s", None, 1.0),
    _at_least_0(SENSORS, "clipped", "limited to plus and minus the value", "in the unit of the channel", None),
    _at_least_0(SENSORS, "nan", "samples that are NaN", "share of the blocks", 1.0, 1.0),
    InjectionKind(SENSORS, "huge", "one huge sample in each block", "in the unit of the channel", 3e38),
    InjectionKind(SENSORS, "swapped", "exchanges its samples with another channel; `other` names it"),
    InjectionKind(SENSORS, "drifting", "an offset that grows", "in the unit of the channel, a second", None),
    InjectionKind(
        SENSORS, "fading", "a gain that changes evenly, and stays above 0", "share a second; below 0: weaker", None
    ),
    InjectionKind(
        SENSORS, "jumping", "an offset that switches on and off every 0.1 s", "in the unit of the channel", None
    ),
    _at_least_0(SENSORS, "noise", "more noise", "sigma, in the unit of the channel", None),
    _at_least_0(SENSORS, "loose", "zero in bursts of about 5 ms", "share of the time", 0.5, 1.0),
    _at_least_0(SENSORS, "coarse", "a coarse resolution", "step, in the unit of the channel", None),
    _at_least_0(SENSORS, "flipped", "one bit of one sample changed", "share of the blocks", 0.01, 1.0),
    _at_least_0(SENSORS, "hum", "a sine of 50 Hz", "amplitude, in the unit of the channel", None),
    _at_least_0(EXCITER, "weak", "delivers a wrong share of its command; above 1: too much", "factor", 0.1, 20.0),
    _at_least_0(EXCITER, "resonant", "its mount is loose and resonates with a damping of 0.05", "Hz", None),
    _at_least_0(EXCITER, "clipping", "its amplitude is limited by the amplifier", "m", None),
    _at_least_0(EXCITER, "hot", "its share falls to the value, with a time constant of 1 s", "factor", 0.3, 1.0),
    InjectionKind(EXCITER, "dead", "does not move"),
    _at_least_0(EXCITER, "slow", "its amplitude changes at most at this rate", "m/s", None),
    InjectionKind(CLOCK, "jump", "t_ns of the blocks is off", "s", None, -1e9, 1e9),
    InjectionKind(CLOCK, "frozen", "t_ns of the blocks stops"),
    InjectionKind(CLOCK, "fast", "t_ns of the blocks runs fast", "share", 0.01, -0.9, 10.0),
    InjectionKind(CLOCK, "renumbered", "the numbers of the blocks are off", "blocks", 1e6, -1e9, 1e15),
    _at_least_0(BUS, "dropped", "messages are lost", "share", 1.0, 1.0),
    _at_least_0(BUS, "repeated", "messages arrive repeatedly", "times", 1.0, 100.0),
    InjectionKind(BUS, "reordered", "every second message arrives after its successor"),
    _at_least_0(BUS, "late", "messages arrive late", "s", None, 10.0),
    _at_least_0(BUS, "jittered", "each message arrives late by a random time", "s at most", None, 10.0),
    InjectionKind(BUS, "held", "messages wait until the fault ends, and then arrive at once"),
    InjectionKind(BUS, "cut", "no message arrives"),
    _at_least_0(BUS, "corrupted", "messages with changed bytes", "share", 1.0, 1.0),
    _at_least_0(BUS, "truncated", "messages that end early", "share", 1.0, 1.0),
    _at_least_0(BUS, "forged", "each message is followed by forged messages of another run", "messages", 1.0, 100.0),
    InjectionKind(PROCESS, "killed", "ends at once, as by kill -9"),
    InjectionKind(PROCESS, "frozen", "stops for for_s, as by SIGSTOP"),
    InjectionKind(PROCESS, "restarted", "ends at once, and restarts for_s later"),
)
KINDS = {(kind.group, kind.kind): kind for kind in ALL}


def group_of(target: str) -> str | None:
    """The group of a target; None for an unknown target."""
    return next((group for group, targets in TARGETS.items() if target in targets), None)
