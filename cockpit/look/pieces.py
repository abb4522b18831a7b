"""The result of a look, with the numbers of each piece of a file whose time begins again, and of each stroke."""

from pathlib import Path
from typing import NamedTuple

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.results import in_json
from bridge.units import counted
from cockpit.look.source import MeasuredRecord, looked_at, pieces_of
from diagnosis.look.look import LookResult
from diagnosis.look.numbers import Number
from diagnosis.look.words import headline, symbol_of, with_interval

_IN_A_LINE = ("mu_s", "mu_k", "static_force_N", "kinetic_force_N")


class Piece(NamedTuple):
    """The numbers of one piece: a recipe step, an appended run."""

    number: int
    start_s: float
    seconds: float
    slips: int
    mean_force_N: float  # in the unit of the record; mean over time, along the motion
    numbers: dict[str, Number]


class Stroke(NamedTuple):
    """The mean of one stroke: a stretch in which the drive goes one way."""

    start_s: float
    seconds: float
    direction: int  # sign of the measured force
    mean_force_N: float  # in the unit of the record, along the motion
    mean_coefficient: float | None  # None: the load is not known


class Looked(NamedTuple):
    """The numbers of a file, with findings on its data and the files that were written."""

    seen: LookResult
    findings: list[Finding]
    written: list[Path]
    pieces: list[Piece]  # empty for a single piece
    JSON_MERGED = "seen"

    @in_json
    def headline(self) -> str:
        """The answer in one line."""
        return headline(self.seen)

    @in_json
    def strokes(self) -> list[Stroke]:
        """The strokes of a rig that moves both ways; empty for a rig with one direction."""
        seen, load_N = self.seen, self.seen.known.load_N
        if len({part.sign for part in seen.parts}) < 2:
            return []
        return [
            Stroke(
                float(part.t_s[0]),
                float(part.t_s[-1] - part.t_s[0]),
                int(part.sign),
                mean := float(part.force_N.mean()),
                mean / load_N if load_N else mean if seen.known.coefficient else None,
            )
            for part in seen.parts
        ]


def looked(record: MeasuredRecord, seen: LookResult, findings: list[Finding], out: list[Path]) -> Looked:
    """The result for all pieces together, with the numbers of each."""
    pieces: list[Piece] = []
    for number, piece in enumerate(pieces_of(record) if record.starts_s else [], 1):
        try:
            of_piece = looked_at(piece)
        except Fault as fault:
            findings.append(Finding("pieces", f"{record.path.name}: piece {number}", fault.line))
            continue
        start_s = record.starts_s[number - 1]
        row = Piece(number, start_s, of_piece.seconds, of_piece.slips, of_piece.mean_force_N, of_piece.numbers)
        pieces.append(row)
    return Looked(seen, findings, out, pieces)


def of_pieces_in_words(result: Looked) -> list[str]:
    """A line for each piece."""
    lines: list[str] = []
    for piece in result.pieces:
        known = [name for name in _IN_A_LINE if name in piece.numbers][:2]
        shown = [f"{symbol_of(name, result.seen)} {with_interval(piece.numbers[name])}" for name in known]
        unit = result.seen.known.force_unit
        mean = f"mean {piece.mean_force_N:.4g}{'' if unit == '1' else f' {unit}'}"
        if "mu_mean" in piece.numbers:
            mean += f", mu {piece.numbers['mu_mean'].value:.4g}"
        when = f"{counted(piece.slips, 'slip')} in {piece.seconds:.3g} s from {piece.start_s:.6g} s"
        lines.append(f"{f'piece {piece.number}':<10} {when}: {', '.join([mean, *shown])}")
    return lines
