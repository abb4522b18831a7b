"""Every effect of a real rig that the nominal rig lacks, and the check of its table in a rig file.

A name means a mechanism; a form is one formula for it. `[effects.NAME]` in a rig file holds `form` (the first one if left
out) and the form's parameters. Off is bit-identical to the nominal rig: effects that only change a number of the rig are
folded into it by `plant.records.build`, the others run in a separate kernel (`plant.core.advance_disturbed`).
"""

from typing import Any, Final

from bridge.config import in_short
from plant.effects.drive import DRIVE
from plant.effects.friction import FRICTION
from plant.effects.friction_memory import FRICTION_MEMORY
from plant.effects.piezo import PIEZO
from plant.effects.row import Effect
from plant.effects.sensors import SENSORS
from plant.effects.structure import STRUCTURE

EFFECTS: Final[dict[str, Effect]] = FRICTION_MEMORY | FRICTION | DRIVE | STRUCTURE | PIEZO | SENSORS


def checked(name: str, table: Any) -> dict[str, float | str]:
    """One `[effects.NAME]` table with its form and every parameter filled in. Raises ValueError: key, value, rule, remedy."""
    if name not in EFFECTS:
        raise ValueError(f"effects.{name}: unknown effect; known: {', '.join(EFFECTS)}")
    if not isinstance(table, dict):
        raise ValueError(
            f"effects.{name} = {in_short(table)}: must be a table; write [effects.{name}] and its keys below it"
        )
    forms = EFFECTS[name].forms
    form = table.get("form", next(iter(forms)))
    if not isinstance(form, str) or form not in forms:
        known = ", ".join(f'"{known}"' for known in forms if known) or "none; leave it out"
        raise ValueError(f"effects.{name}.form = {in_short(form)}: unknown form; known: {known}")
    rows = {row.name: row for row in forms[form].parameters}
    filled: dict[str, float | str] = {"form": form}
    for key, value in table.items():
        if key != "form" and key not in rows:
            raise ValueError(f"effects.{name}.{key}: unknown key; known here: form, {', '.join(rows)}")
        if key != "form" and (isinstance(value, bool) or not isinstance(value, int | float)):
            raise ValueError(f"effects.{name}.{key} = {in_short(value)}: must be a number")
    for row in rows.values():
        value = table.get(row.name, row.default)
        if not row.low <= value <= row.high:
            raise ValueError(f"effects.{name}.{row.name} = {value}: must be from {row.low:g} to {row.high:g}")
        filled[row.name] = float(value)
    return filled
