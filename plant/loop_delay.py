"""Delayed commands: each acts a whole number of blocks after its arrival, in the order of arrival."""

import math
from typing import Final

from bridge.kernel import kernel
from bridge.layouts import CommandRow, PlantMemory

LONGEST_DELAY_S: Final = 0.2  # highest loop.delay_s; 50 ms is a slow converter on USB with its driver's queue
LONGEST_JITTER_S: Final = 0.1  # highest loop.jitter_s
# length of the queue of commands: one per block of 0.25 ms over delay and jitter, and the present one
LINE: Final = round((LONGEST_DELAY_S + LONGEST_JITTER_S) / 0.25e-3) + 1


def whole_blocks(time_s: float, block_s: float) -> int:
    """The number of blocks in a time, rounded up; a rounding error does not add a block."""
    return max(math.ceil(time_s / block_s - 1e-6), 0)


@kernel
def send(s: PlantMemory, command: CommandRow, delay_blocks: int) -> None:
    """Queue a command received before block `s.block`; it acts `delay_blocks` later."""
    due = s.block + delay_blocks
    if s.line_count > 0:
        newest = (s.line_first + s.line_count - 1) % LINE
        due = max(due, s.line_due[newest])
    at = (s.line_first + s.line_count) % LINE
    s.line_due[at] = due
    s.line_block[at] = command.block
    s.line_Hz[at] = command.frequency_Hz
    s.line_m[at] = command.amplitude_m
    s.line_count += 1


@kernel
def receive(s: PlantMemory) -> None:
    """Take the newest command that is due in block `s.block`, if any, as the command in force."""
    while s.line_count > 0 and s.line_due[s.line_first] <= s.block:
        s.commanded_Hz = s.line_Hz[s.line_first]
        s.commanded_m = s.line_m[s.line_first]
        s.command_block = s.line_block[s.line_first]
        s.line_first = (s.line_first + 1) % LINE
        s.line_count -= 1
