"""The result of `stickslip look`."""

from pathlib import Path
from typing import NamedTuple

from bridge.log.finding import Finding
from bridge.results import in_json
from diagnosis.look.look import LookResult
from diagnosis.look.words import headline


class Looked(NamedTuple):
    """The numbers of a file, with findings on its data and the files that were written."""

    seen: LookResult
    findings: list[Finding]
    written: list[Path]
    JSON_MERGED = "seen"

    @in_json
    def headline(self) -> str:
        """The answer in one line."""
        return headline(self.seen)
