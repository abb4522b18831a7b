"""A diagnosis as a rig file: the refitted numbers, and the named effects with their fitted parameters."""

import math
from pathlib import Path
from typing import Any, Final

from bridge.config import validate
from bridge.faults import Fault
from bridge.files import write_whole
from diagnosis.evidence.folder import Evidence
from diagnosis.evidence.manifest import rig_file_tables
from diagnosis.hypotheses.hypothesis import LEVELS, MASS
from diagnosis.model.per_run import as_in_rig_file
from diagnosis.report.words import headline
from diagnosis.result import Diagnosis
from plant.config import RigConfig

_DIGITS = 7
RIG_BEGINS = "# Written by `stickslip diagnose` "
NO_RIG: Final = {  # reasons by verdict
    "unexplained": "nothing explains the gap",
    "partly": "only a part of the gap is explained",
    "not-finished": "no cause was tried",
}


def write_rig(diagnosis: Diagnosis, evidence: Evidence, path: Path) -> None:
    """Write the corrected rig to `path`, completely or not at all; `stickslip run --rig` reads it.

    Raises Fault CONFIG where the diagnosis gives no rig that the plant can simulate, OSError when the file cannot be written.
    """
    refuse_force_drive(evidence)
    name = evidence.folder.name
    if diagnosis.verdict in NO_RIG:
        raise Fault(
            "CONFIG",
            f"{name}: the verdict is {diagnosis.verdict}: no effect to apply; measure the next run that the diagnosis "
            "suggests, and diagnose again",
        )
    table = rig_table(diagnosis, evidence)
    validate(RigConfig, table, f"the rig diagnosed from {name}")
    write_whole(path, _comment(diagnosis, evidence) + _toml(table))


def refuse_force_drive(evidence: Evidence) -> None:
    """Raise Fault CONFIG for a force-driven rig, which no rig file can describe."""
    name = evidence.folder.name
    if evidence.rig.drive == "force":
        raise Fault(
            "CONFIG",
            f'{name}: rig.drive = "force": a rig file cannot describe it, the simulated rig pulls through a spring; use the '
            "parameters in the JSON of the diagnosis",
        )


def rig_table(diagnosis: Diagnosis, evidence: Evidence) -> dict[str, Any]:
    """The corrected rig as the tables of a rig file, named after the evidence's folder."""
    # The two forces are refitted independently and may cross.
    values = evidence.rig.values() | {parameter.name: parameter.retuned for parameter in diagnosis.rig}
    described = diagnosis.verdict == "described"  # these numbers include the level effects; none includes the mass
    values |= {number.name: number.found for number in diagnosis.numbers if described or number.name == LEVELS[MASS]}
    table: dict[str, Any] = {"name": f"{_word(evidence.folder.name)}-diagnosed", **rig_file_tables(values)}
    effects: dict[str, dict[str, float | str]] = {}
    for name in diagnosis.effects if not described else ():
        candidate = next(candidate for candidate in diagnosis.candidates if candidate.effect == name)
        effects[name] = {"form": candidate.form} if candidate.form else {}
        effects[name] |= as_in_rig_file({key: estimate.value for key, estimate in candidate.parameters.items()})
    return table | {"effects": effects} if effects else table


def _comment(diagnosis: Diagnosis, evidence: Evidence) -> str:
    lines = []
    if diagnosis.verdict != "no-gap":
        lines.append(f"Verdict: {headline(diagnosis)}.")
    else:
        lines.append("Verdict: no gap: the rig as described, refitted inside its tolerances.")
    gap = diagnosis.gap
    if gap.files and math.isfinite(gap.with_effect):
        lines.append(
            f"Gap on held-out runs, in noise floors: {gap.nominal:.3g} as described, {gap.with_effect:.3g} so."
        )
    lines += [f"The runs cannot separate: {', '.join(group)}." for group in diagnosis.not_distinguishable]
    lines.append("Piezo, sensors and drive profile are not given here: they keep the values of the paper's rig.")
    first = f"{RIG_BEGINS}from the evidence {_word(evidence.folder.name)}.\n"
    return first + "".join(f"# {line}\n" for line in lines)


def _toml(table: dict[str, Any]) -> str:
    lines = [f'name = "{table["name"]}"']
    for part in ("contact", "slide", "drive"):
        lines += ["", f"[{part}]", *(_line(key, value) for key, value in table[part].items())]
    for name, values in table.get("effects", {}).items():
        lines += ["", f"[effects.{name}]", *(_line(key, value) for key, value in values.items())]
    return "\n".join(lines) + "\n"


def _line(key: str, value: float | str) -> str:
    if isinstance(value, str):
        return f'{key} = "{value}"'
    text = f"{value:.{_DIGITS}g}"
    # TOML reads 1e5 and 1.0 as floats, and 1 as an integer
    return f"{key} = {text}" if any(mark in text for mark in ".e") else f"{key} = {text}.0"


def _word(text: str) -> str:
    """A folder's name, with dashes in place of characters that a quoted name or a comment cannot hold."""
    return "".join(letter if letter.isprintable() and letter not in '"\\' else "-" for letter in text) or "evidence"
