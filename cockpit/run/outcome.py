"""The result of `stickslip run`."""

from typing import NamedTuple

from cockpit.judge.margins import Margins, margins_in_words
from cockpit.judge.phases import Phase
from cockpit.judge.verdict import RunVerdict
from cockpit.judge.verdict_words import in_words


class RunOutcome(NamedTuple):
    """Verdict of a run, and its rig."""

    verdict: RunVerdict
    rig: str
    effects: list[str]  # of the rig
    loop: Margins | None  # only for a rig with effects, for which the loop was not designed
    without: Phase | None  # the stretch `after`, simulated without the controller, with `--without`
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
