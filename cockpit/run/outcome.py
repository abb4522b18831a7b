"""The result of `stickslip run`."""

from typing import NamedTuple

from cockpit.judge.margins import Margins, margins_in_words
from cockpit.judge.phases import Phase
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import in_words


class RunOutcome(NamedTuple):
    """Verdict on a run, name and effects of its rig."""

    verdict: RunVerdict
    rig: str
    effects: list[str]  # effects of the rig
    loop: Margins | None  # None for a rig without effects, as the loop was designed for it
    without: Phase | None  # the stretch `after`, simulated without the controller; None without the option `--without`
    JSON_MERGED = "verdict"
    JSON_OPTIONAL = "effects", "loop", "without"

    def in_words(self, verbose: bool) -> list[str]:
        """The verdict in six lines; with `verbose` all figures."""
        lines = in_words(self.verdict, verbose, self.without)
        if not verbose:
            return lines
        margins = margins_in_words(self.loop) if self.loop is not None else []
        return [
            *lines,
            f"rig      {self.rig}" + (f", with {', '.join(self.effects)}" if self.effects else ""),
            *margins,
        ]
