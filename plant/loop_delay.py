"""Commands on their way to the exciter: each acts some whole blocks after it came, in the order in which they came."""

import math
from typing import Final

from bridge.kernel import Record, kernel

LONGEST_DELAY_S: Final = 0.2  # of loop.delay_s; 50 ms is a slow converter on USB with its driver's queue
LONGEST_JITTER_S: Final = 0.1
# commands on their way at most: one a block of 0.25 ms over delay and jitter, and the one of now
LINE: Final = round((LONGEST_DELAY_S + LONGEST_JITTER_S) / 0.25e-3) + 1


def whole_blocks(time_s: float, block_s: float) -> int:
    """The blocks that a time takes, rounded up; not one more where it is a whole number of them but for rounding."""
    return max(math.ceil(time_s / block_s - 1e-6), 0)


@kernel
def send(s: Record, command: Record, delay_blocks: int) -> None:
    """Note a command that came before block `s.block`; it acts from the block that is `delay_blocks` later."""
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
def receive(s: Record) -> None:
    """Take the newest command that is due in block `s.block`, if any, as the command in force."""
    while s.line_count > 0 and s.line_due[s.line_first] <= s.block:
        s.commanded_Hz = s.line_Hz[s.line_first]
        s.commanded_m = s.line_m[s.line_first]
        s.command_block = s.line_block[s.line_first]
        s.line_first = (s.line_first + 1) % LINE
        s.line_count -= 1
