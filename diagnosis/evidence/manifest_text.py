"""`manifest.toml` as text."""

import json
from typing import Any

from diagnosis.evidence.manifest import FORMAT, RigTable, RunTable


def manifest_text(rig: RigTable, runs: list[RunTable], assumed: list[str]) -> str:
    """Text of a `manifest.toml` with this rig and these runs; rig numbers in `assumed` are marked as assumed."""
    lines = [f"format = {_value(FORMAT)}", "", *rig_lines(rig, assumed)]
    for run in runs:
        lines += ["", "[[run]]"]
        plain = run.model_dump(exclude={"channels"})
        usual = {"from_s": 0.0, "tare_N": 0.0}
        lines += [f"{name} = {_value(value)}" for name, value in plain.items() if value not in (None, usual.get(name))]
        for name, channel in run.channels.items():
            keys = [f"{key} = {_value(value)}" for key, value in channel.model_dump(exclude_defaults=True).items()]
            lines.append(f"channels.{name} = {{ {', '.join(keys)} }}")
    return "\n".join(lines) + "\n"


def rig_lines(rig: RigTable, assumed: list[str]) -> list[str]:
    """The lines of [rig] and [rig.tolerance]."""
    lines = ["[rig]", f"drive = {_value(rig.drive)}"]
    numbers = {"radius_m": rig.radius_m, **rig.values(), "force_per_current_N_per_A": rig.force_per_current_N_per_A}
    for name, value in numbers.items():
        if value is not None:
            lines.append(f"{name} = {_value(value)}" + ("  # assumed, not measured" if name in assumed else ""))
    if rig.tolerance:
        lines += ["", "[rig.tolerance]", *(f"{name} = {_value(value)}" for name, value in rig.tolerance.items())]
    return lines


def _value(value: Any) -> str:
    """A number, a truth value or a text in TOML: as in JSON, except DEL; `repr` keeps every digit of a number."""
    return repr(value) if isinstance(value, float) else json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
