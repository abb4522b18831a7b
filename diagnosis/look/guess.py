"""Which column of a table is the time, the force, the load, the drive's position: by names, units and values."""

import re
from typing import NamedTuple

import numpy as np

from bridge.arrays import Floats
from bridge.faults import Fault
from bridge.tables.table import Table
from bridge.tables.unit_words import bare_name, known_unit, weight_unit

_NAMES = {
    "time": r"^(t|ts|time|zeit|x_value|timestamp|elapsed.*|.*\btime\b.*|.*zeit.*|__time|%time|.*stamp.*|sekunden"
    r"|seconds?|m?sec|ms|us|(milli|micro|nano)s(ec(ond)?s?)?|temps|czas|tiempo|tempo|время|时间|時間)$",
    "coefficient": r"(^|[^a-z])(mu|µ|cof|c\.o\.f)([^a-z]|$)|coeff.*(fric|trac)|(fric|trac).*coeff"
    r"|reib(bei)?wert|reibungskoeff|reibzahl",
    "load": r"normal|(^|[^a-z])(fz|fn|f_n|f_z|load|last)([^a-z]|$)|auflast|anpress",
    "force": r"friction|reib|tangent|drag|(^|[^a-z])(ff|fx|f_x|f_t|ft|f_d|f)([^a-z]|$)|force|kraft|last?zelle|load ?cell"
    r"|torque|moment|effort",
    "speed": r"speed|veloc|geschw|(^|[^a-z])(v|v_d)([^a-z]|$)",
    "position": r"drive.*pos|(^|[^a-z])pos([^a-z]|$)|crosshead|extension|stroke|hub|verfahrweg|stage|position"
    r"|(^|[^a-z])(s_d|x_d)([^a-z]|$)|displacement|weg|travel|distance|angle|winkel|(^|[^a-z])(x|s|phi|theta)([^a-z]|$)",
}  # fmt: skip
_QUANTITIES = {
    "time": ("time",),
    "load": ("force",),
    "force": ("force", "torque"),
    "position": ("length", "angle"),
    "speed": ("velocity", "angular velocity"),
    "coefficient": ("share",),
    "frequency": ("frequency",),
}
# columns that show stick-slip where no force is measured, the clearest first
_STAND_INS = {
    "a following error": r"foll.*err|(^|[^a-z])f?_?err(or)?([^a-z]|$)|schlepp|nachlauf|(^|[^a-z])lag([^a-z]|$)|regelabw|contour",
    "a motor current or torque": r"current|strom|torque|moment|(^|[^a-z])i_?[qa]?([^a-z]|$)|load ?%|auslastung|effort",
}
_FREQUENCY = r"^freq(uency|uenz)?s?$"  # first column of a spectrum
_FEWEST_STEPS = 8
# columns that are never used as force, load, speed or position, even if their name matches
_OTHER = re.compile(r"acc|beschl|temp|humid|feucht|count|zyklus|cycle|voltage|current", re.IGNORECASE)

# names of commanded values: excluded as the force, which must be measured; a commanded position is as good as a measured one
_WANTED = re.compile(r"soll|set.?p(oin)?t|target|demand|command|nominal", re.IGNORECASE)


class Guess(NamedTuple):
    """The column of each quantity; empty without such a column. `reasons` explains each choice."""

    time: str
    force: str
    load: str
    position: str
    speed: str
    coefficient: str
    reasons: list[str]
    stands_in: str = (
        ""  # content of the column of the force, if it holds another quantity: an error, a current, a position
    )


def guess(table: Table, given: dict[str, str]) -> Guess:
    """The columns of a record; `given` holds the columns that the operator has named, by time, force, load or position.

    Raises Fault CONFIG with a line to copy where no column can be identified as the force.
    """
    numeric = [name for name in _numeric(table) if name not in table.own_times.values()]
    chosen: dict[str, str] = {what: table.find(column) for what, column in given.items() if column}
    reasons: list[str] = []
    for what in ("coefficient", "time", "load", "force", "speed", "position"):
        if what in chosen or (what == "time" and table.own_times):
            continue
        left = [name for name in (list(table.columns) if what == "time" else numeric) if name not in chosen.values()]
        column = _named(table, what, left)
        if column:
            chosen[what] = column
            reasons.append(f"{what} = {column!r} by its name")
    if "load" in chosen and "load" not in given and not {"force", "coefficient"} & chosen.keys():
        _refuse_empty_force(table, numeric)
        chosen["force"] = chosen.pop("load")  # testing machines call their measured force the load
        reasons = [reason for reason in reasons if not reason.startswith("load = ")]
        reasons.append(f"force = {chosen['force']!r}, as no other column is one")
    left = [name for name in numeric if name not in chosen.values()]
    if "time" not in chosen and not table.clocks:
        if spectrum := next((name for name in left if _is_frequency(table, name) and _rises(table, name)), ""):
            line = f"column {spectrum!r} is a frequency, so this is a spectrum: must be a record over time"
            raise Fault(
                "CONFIG",
                f"{table.path.name}: {line}; give the record that it was made from, or name another column by --time",
            )
        # with a column that numbers the rows, or one named as a time, an evenly rising one may be the position of an even drive
        named = any(re.search(_NAMES["time"], bare_name(name), re.IGNORECASE) for name in table.columns)
        clocks = [] if named or any(_numbers_rows(table, name) for name in left) else left
        clues = (
            ([name for name in table.columns if name not in numeric], _has_dates, "holds times"),
            (left, _rises_in_time, "rises evenly and has a unit of time"),
            (clocks, _rises, "rises in even steps"),
        )
        for names, shows_time, why in clues:
            if name := next((name for name in names if shows_time(table, name)), ""):
                chosen["time"] = name
                reasons.append(f"time = {name!r}, which {why}")
                break
    left = [name for name in numeric if name not in chosen.values()]
    stands_in = ""
    if "force" not in chosen and "coefficient" not in chosen and not any(_in(table, name, "force") for name in left):
        stands_in, chosen["force"] = _stand_in(table, left, chosen.get("position", ""))
        if stands_in:
            reasons.append(f"no force: {stands_in} {chosen['force']!r} shows stick-slip in its place")
        else:
            del chosen["force"]
    if "force" not in chosen and "coefficient" not in chosen:
        by_unit = [name for name in left if _in(table, name, "force")]
        if len(by_unit) != 1:
            _refuse_empty_force(table, numeric)
        only = (
            by_unit
            if len(by_unit) == 1
            else [name for name in left if not (_OTHER.search(name) or _rises(table, name))]
        )
        if len(only) != 1:
            raise Fault("CONFIG", _ask(table, numeric))
        what = "coefficient" if (known_unit(table.unit(only[0])) or ("",))[0] == "share" else "force"
        chosen[what] = only[0]
        reasons.append(f"{what} = {only[0]!r}, the only one left")
    if "position" in chosen and _flat(table, chosen["position"]):
        del chosen["position"]
    for what in ("load", "position", "speed"):
        if what not in chosen and (empty := _empty(table, what, numeric)):
            reasons.append(f"no {what}, as column {empty!r} holds no number")
    kinds = ("time", "force", "load", "position", "speed", "coefficient")
    time, force, load, position, speed, coefficient = (chosen.get(what, "") for what in kinds)
    return Guess(time, force, load, "" if position == force else position, speed, coefficient, reasons, stands_in)


def _stand_in(table: Table, left: list[str], position: str) -> tuple[str, str]:
    """The quantity that shows stick-slip where no column is a force, and its column; empty without such a column."""
    moving = [name for name in left if not _flat(table, name)]
    for what, pattern in _STAND_INS.items():
        if name := next((name for name in moving if re.search(pattern, bare_name(name), re.IGNORECASE)), ""):
            return what, name
    return ("a position", position) if position and not _flat(table, position) else ("", "")


def _in(table: Table, name: str, what: str) -> bool:
    """Whether the unit of a column belongs to the wanted quantity."""
    return (known_unit(table.unit(name)) or ("",))[0] in _QUANTITIES[what]


def _refuse_empty_force(table: Table, numeric: list[str]) -> None:
    """Raise Fault CONFIG where a column is named as the force and holds no number: no other column may replace it."""
    if empty := _empty(table, "force", numeric):
        text = f"{table.path.name}: column {empty!r} holds no number: must hold the force, by its name"
        raise Fault(
            "CONFIG", f'{text}; let a spreadsheet program calculate and save its formulas, or add --force "NAME"'
        )


def no_time(table: Table) -> str:
    """The question for the time, with the reason why a column that is named as a time holds none."""
    known = ", ".join(f'"{name}"' for name in table.columns)
    ask = 'which column is the time, or how many rows per second are there? Add --time "NAME" or --rate 1kHz'
    ask += f"; columns here: {known}"
    for name, values in table.columns.items():
        if re.search(_NAMES["time"], bare_name(name), re.IGNORECASE):
            try:
                table.column(name)
            except Fault:
                begin = str(values[0])[:40]
                return (
                    f"column {name!r} begins with {begin!r}, which is not read as a number, date or clock time; {ask}"
                )
    return ask


def unused(table: Table, guessed: Guess) -> list[str]:
    """Columns with numbers that are not read, each once."""
    used = {guessed.time, guessed.force, guessed.load, guessed.position, guessed.speed, guessed.coefficient}
    used |= {source for name in used for source in table.derived.get(name, ())}
    same = {id(table.columns[name]) for name in used if name}
    return [
        name
        for name in _numeric(table)
        if name not in used and id(table.columns[name]) not in same and name not in table.own_times.values()
    ]


def _empty(table: Table, what: str, numeric: list[str]) -> str:
    """A column that is named as the wanted quantity and has no cell with a value; empty without such a column."""
    named = (name for name in table.columns if name not in numeric and re.search(_NAMES[what], bare_name(name), re.I))
    if what == "force":
        named = (name for name in named if not re.search(_NAMES["load"], bare_name(name), re.I))  # a normal force
    return next((name for name in named if _is_empty(table, what, name)), "")


def _is_empty(table: Table, what: str, name: str) -> bool:
    """Whether no cell holds a number; a column of words counts only if its unit belongs to the wanted quantity."""
    try:
        return not np.isfinite(table.column(name)).any()
    except Fault:
        return _in(table, name, what)


def _ask(table: Table, numeric: list[str]) -> str:
    if not numeric:
        return f"{table.path.name}: no column holds 4 numbers or more; give a file with at least 16 rows of data"
    columns = ", ".join(f'"{name}"' for name in numeric)
    sheet = f" (sheet {table.written['sheet']!r}; a map reads another one)" if "sheet" in table.written else ""
    return f'{table.path.name}: which column is the force? add --force "NAME"; columns here{sheet}: {columns}'


def _numeric(table: Table) -> list[str]:
    names: list[str] = []
    rows = max((len(values) for values in table.columns.values()), default=0)
    for name, values in table.columns.items():
        if len(values) < max(rows // 50, 4):  # a parameter, not a time series
            continue
        try:
            if np.isfinite(table.column(name)).sum() >= 4:
                names.append(name)
        except Fault:
            continue
    return _one_each(table, names)


def _one_each(table: Table, names: list[str]) -> list[str]:
    """The shortest name of each column, as a column may have a long and a short name."""
    seen: dict[int, str] = {}
    for name in names:
        key = id(table.columns[name])
        if key not in seen or len(name) < len(seen[key]):
            seen[key] = name
    return [name for name in names if seen[id(table.columns[name])] == name]


def _named(table: Table, what: str, names: list[str]) -> str:
    pattern = re.compile(_NAMES[what], re.IGNORECASE)
    for name in names:
        if what not in ("time", "coefficient") and _OTHER.search(name):
            continue
        if what == "force" and _WANTED.search(name):
            continue
        if what in ("force", "position") and _flat(table, name):
            continue
        if what == "time" and not _has_times(table, name):
            continue
        unit = table.unit(name)
        quantity = ((weight_unit if what in ("force", "load") else known_unit)(unit) or ("",))[0]
        if quantity and quantity not in _QUANTITIES[what]:
            continue
        if what == "position" and not quantity and _numbers_rows(table, name):
            continue
        if pattern.search(bare_name(name).lstrip("/").split("/")[-1]) or pattern.search(bare_name(name)):
            return name
    return ""


def _is_frequency(table: Table, name: str) -> bool:
    return re.search(_FREQUENCY, bare_name(name), re.IGNORECASE) is not None or _in(table, name, "frequency")


def _has_times(table: Table, name: str) -> bool:
    """Whether a column holds any time: LabVIEW names columns that it leaves empty."""
    try:
        return bool(np.isfinite(table.seconds(name)[0]).any())
    except Fault:
        return False


def _has_dates(table: Table, name: str) -> bool:
    """Whether a column holds dates or clock times, and no numbers."""
    try:
        return table.seconds(name)[1]
    except Fault:
        return False


def _rises_in_time(table: Table, name: str) -> bool:
    return _in(table, name, "time") and _rises(table, name)


def _rises(table: Table, name: str) -> bool:
    steps = _steps(table, name)
    if len(steps) <= _FEWEST_STEPS or not (steps > 0.0).all():
        return False
    return float(np.ptp(steps)) < 0.2 * float(np.median(steps)) + 1e-12


def _numbers_rows(table: Table, name: str) -> bool:
    steps = _steps(table, name)
    return len(steps) > _FEWEST_STEPS and bool((steps == 1.0).all())


def _steps(table: Table, name: str) -> Floats:
    values = table.column(name)
    return np.diff(values[np.isfinite(values)])


def _flat(table: Table, name: str) -> bool:
    values = table.column(name)
    return not np.isfinite(values).any() or float(np.nanmax(values) - np.nanmin(values)) == 0.0
