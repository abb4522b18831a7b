"""Every kind of fault by name: what it may be done to, what its value means, and its default."""

import math
from typing import NamedTuple

from bridge.wire.messages import CHANNELS

SENSORS, EXCITER, CLOCK, BUS, PROCESS = "sensors", "exciter", "clock", "bus", "process"
ALL_SENSORS = "sensors"
LINK = "link"  # both directions
LARGEST = 3.4e38  # of a sample on the wire
# what a fault is done to, by group
TARGETS = {
    SENSORS: (*CHANNELS, ALL_SENSORS),
    EXCITER: ("exciter",),
    CLOCK: ("clock",),
    BUS: ("blocks", "commands", LINK),
    PROCESS: ("controller", "plant", "recorder"),
}


class Kind(NamedTuple):
    """One kind of fault."""

    group: str
    kind: str
    help: str
    value: str = ""  # what the value is, with its unit; empty: it has none
    default: float | None = None  # of the value; None where it has none or must be given
    lowest: float = -math.inf  # of the value
    highest: float = math.inf


def _at_least_0(group: str, kind: str, told: str, value: str, default: float | None, highest: float = math.inf) -> Kind:
    return Kind(group, kind, told, value, default, 0.0, highest)


ALL = (
    Kind(SENSORS, "off", "reads one level: unplugged, or without its supply", "level, in the unit of the channel", 0.0),
    Kind(SENSORS, "stuck", "holds the sample before the fault"),
    Kind(SENSORS, "frozen", "repeats the block before the fault"),
    _at_least_0(SENSORS, "garbage", "any number between plus and minus the value", "in the unit of the channel", None),
    Kind(SENSORS, "scaled", "another gain, another unit; below 0: another sign", "factor", None),
    Kind(SENSORS, "offset", "one step", "in the unit of the channel", None),
    _at_least_0(SENSORS, "delayed", "late against the other channels", "s", None, 1.0),
    _at_least_0(SENSORS, "clipped", "no further than plus and minus the value", "in the unit of the channel", None),
    _at_least_0(SENSORS, "nan", "samples that are no numbers", "share of the blocks", 1.0, 1.0),
    Kind(SENSORS, "huge", "one sample of each block", "in the unit of the channel", 3e38),
    Kind(SENSORS, "swapped", "shows another channel, and that one shows this; `other` names it"),
    Kind(SENSORS, "drifting", "an offset that grows", "in the unit of the channel, a second", None),
    Kind(SENSORS, "fading", "a gain that changes evenly, and stays above 0", "share a second; below 0: weaker", None),
    Kind(SENSORS, "jumping", "an offset that comes and goes every 0.1 s", "in the unit of the channel", None),
    _at_least_0(SENSORS, "noise", "more noise", "sigma, in the unit of the channel", None),
    _at_least_0(SENSORS, "loose", "zero in bursts of some 5 ms", "share of the time", 0.5, 1.0),
    _at_least_0(SENSORS, "coarse", "a coarse resolution", "step, in the unit of the channel", None),
    _at_least_0(SENSORS, "flipped", "one bit of one sample changed", "share of the blocks", 0.01, 1.0),
    _at_least_0(SENSORS, "hum", "a sine of 50 Hz", "amplitude, in the unit of the channel", None),
    _at_least_0(EXCITER, "weak", "delivers another share of its command; above 1: too much", "factor", 0.1, 20.0),
    _at_least_0(EXCITER, "resonant", "its mount is loose and resonates with a damping of 0.05", "Hz", None),
    _at_least_0(EXCITER, "clipping", "its amplifier gives no more", "m", None),
    _at_least_0(EXCITER, "hot", "its share falls to the value, with a time constant of 1 s", "factor", 0.3, 1.0),
    Kind(EXCITER, "dead", "does not move"),
    _at_least_0(EXCITER, "slow", "its amplitude changes no faster", "m/s", None),
    Kind(CLOCK, "jump", "t_ns of the blocks is off", "s", None, -1e9, 1e9),
    Kind(CLOCK, "frozen", "t_ns of the blocks stands"),
    Kind(CLOCK, "fast", "t_ns of the blocks runs fast", "share", 0.01, -0.9, 10.0),
    Kind(CLOCK, "renumbered", "the numbers of the blocks are off", "blocks", 1e6, -1e9, 1e15),
    _at_least_0(BUS, "dropped", "messages are lost", "share", 1.0, 1.0),
    _at_least_0(BUS, "repeated", "messages come again", "times", 1.0, 100.0),
    Kind(BUS, "reordered", "each second message comes after the one that follows it"),
    _at_least_0(BUS, "late", "messages come late", "s", None, 10.0),
    _at_least_0(BUS, "jittered", "messages come late by another time each", "s at most", None, 10.0),
    Kind(BUS, "held", "messages wait until the fault ends, and then come at once"),
    Kind(BUS, "cut", "nothing comes through"),
    _at_least_0(BUS, "corrupted", "messages with changed bytes", "share", 1.0, 1.0),
    _at_least_0(BUS, "truncated", "messages that end early", "share", 1.0, 1.0),
    _at_least_0(BUS, "forged", "with each message one more, which no process of this run sent", "messages", 1.0, 100.0),
    Kind(PROCESS, "killed", "ends at once, as by kill -9"),
    Kind(PROCESS, "frozen", "stands still for for_s, as by SIGSTOP"),
    Kind(PROCESS, "restarted", "ends at once, and begins anew for_s later"),
)
KINDS = {(one.group, one.kind): one for one in ALL}


def group_of(target: str) -> str | None:
    """The group of a target; None for one that is not known."""
    return next((group for group, targets in TARGETS.items() if target in targets), None)
