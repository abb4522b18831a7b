"""Pages of docs/reference that are generated from the code by `make docs`; they are not in git."""

import inspect
import json
import shlex
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import typer.main
from typer.testing import CliRunner

from bridge.config import Strict
from bridge.faults import FAULTS
from bridge.tables.kinds import FOREIGN
from bridge.wire.event_codes import EVENTS, SEVERITIES
from bridge.wire.words import words
from cockpit import cli
from cockpit.judge.finding_codes import FINDINGS
from cockpit.run.scenario import Scenario
from diagnosis.evidence.import_table import ImportMap
from diagnosis.evidence.manifest import Manifest
from docs import constants, zenoh_files
from plant.effects.library import EFFECTS
from plant.effects.row import Formula
from plant.pairs import PAIRS
from tests.unit.cockpit import files_of_others
from tests.unit.diagnosis.evidence import foreign_tables

FOLDER = Path(__file__).parent / "reference"
_MADE = "<!-- Made by `make docs`; change the code instead. -->\n"
_SYMBOLS = """\
Symbols: `F_c`, `F_s` Coulomb and static friction; `v_s` Stribeck velocity; `v_r` velocity in the contact; `x` position of
the slide; `s_e` where the drive would be without ripple; `e` extension of the drive's spring; `k_d`, `h_d` stiffness and
damping of the drive; `F_d` drive force; `F_f` friction; `age` time at rest; `t` time of the run; `f` frequency of the
vibration; `w(a) = sin a + second_sin sin 2a + second_cos cos 2a`, `a` with the phase."""
_EFFECTS_INTRO = f"""\
Differences between a real rig and the ideal rig. An effect is a mechanism, a form is one formula for it. Each is off unless a
rig file has its table `[effects.NAME]`, with `form` (the first one if left out) and the form's parameters; off is
bit-identical to the ideal rig. The diagnosis tries every form of every effect. `tests/truth/test_effects_*` holds each
formula against a closed form or SciPy.

{_SYMBOLS}"""
_FAULTS_INTRO = (
    "`stickslip explain CODE` prints the same, and `stickslip explain WORD` a [word of a log](#words-of-a-log)."
)
_WORDS_INTRO = """\
Meaning of the numbers in the columns `mode`, `state`, `reason` and `limit` of a log and of its tables.
`stickslip explain reason` prints a column, `stickslip explain EXCITER_END` a word."""
_EVENTS_INTRO = """\
Events that plant, controller and recorder publish on the bus and in a log. The severity follows NAMUR NE 107: failure (data
were lost, or a part does not work), out of specification, check (an operator's action, or a test), maintenance, or news.
A run with a failure is not good. `stickslip explain GAP` prints one, `stickslip explain event` all of them."""
_FILES_INTRO = """\
Keys of the TOML files, with their defaults and ranges. A misspelt key or a value out of range is an error that names file,
key, rule and remedy. Units are in the names."""
_GONE_INTRO = """\
Keys of older scenarios. They are still read, so that an old file works, but ignored: a line on stderr names the
replacement."""
_PROGRAMS_INTRO = """\
The tests open a file in the way of each program. Columns are found by their names and units, so files with other
names open too; [look](../guides/look.md) prints an option to add if it needs one."""
_FILES: tuple[tuple[str, str, type[Strict]], ...] = (
    (
        "Scenario",
        "`deploy/scenarios/*.toml`, `--scenario FILE`. The keys below `rig` are the keys of a rig file.",
        Scenario,
    ),
    ("Evidence manifest", "`manifest.toml` of an evidence folder; rules are in [evidence/1](evidence-1.md).", Manifest),
    (
        "Import map",
        "`stickslip log import --map FILE`; an example is in [import data](../guides/import-data.md).",
        ImportMap,
    ),
)
_VALUES = {"String": "TEXT", "Int": "N", "Float": "NUMBER", "Path": "PATH"}


def pages() -> dict[str, str]:
    """Text of every made page, by file name in docs/reference."""
    made = {"commands.md": _commands(), "effects.md": _effects(), "faults.md": _faults(), "files.md": _files()}
    made["constants.md"] = _constants()
    made["programs.md"] = _programs()
    return {name: "\n".join((title, "", _MADE, *lines, "")) for name, (title, *lines) in made.items()}


def _constants() -> list[str]:
    rows = dict(constants.sections())
    numbers = [row for rows_of_room in rows.values() for row in rows_of_room]
    lines = [
        "# Constants of the diagnosis",
        f"The diagnosis decides by {len(numbers)} numbers in {len({row[1] for row in numbers})} files of `diagnosis/`. Where no"
        " count is named, the number follows from its description, or is a step of the computation.", "",
    ]  # fmt: skip
    for room, rows_of_room in rows.items():
        lines += [f"## {room}", "", *_table(("constant", "file", "value", "effect", "counted in"), rows_of_room)]
    return lines[:-1]


def _table(head: Iterable[str], rows: Iterable[Iterable[str]]) -> list[str]:
    """Lines of a Markdown table, and an empty one."""
    names = list(head)
    cells = [[cell.replace("|", "\\|").replace("\n", " ") for cell in row] for row in rows]
    return [f"| {' | '.join(row)} |" for row in (names, ["---"] * len(names), *cells)] + [""]


def _number(value: float) -> str:
    return f"{value:g}".replace("e-0", "e-").replace("e+0", "e")


# commands


def _commands() -> list[str]:
    root = typer.main.get_command(cli.app)
    commands = list(_walk(root, "stickslip"))
    rows = [(f"[`{name}`](#{name.replace(' ', '-')})", _first_sentence(command.help)) for name, command in commands]
    lines = ["# Commands", *_table(("command", "purpose"), rows)]
    for name, command in commands:
        lines += [f"## {name}", "", _paragraph(command.help), ""]
        params = [param for param in command.params if not getattr(param, "hidden", False) and not param.is_eager]
        if params:
            lines += _table(("argument or option", "meaning"), ((_spelt(param), _meaning(param)) for param in params))
    return lines


def _walk(command: Any, name: str) -> Iterator[tuple[str, Any]]:
    inner = getattr(command, "commands", None)
    if inner is None:
        yield name, command
        return
    for key in sorted(inner):
        if not inner[key].hidden:
            yield from _walk(inner[key], f"{name} {key}")


def _paragraph(text: str | None) -> str:
    return " ".join(inspect.cleandoc(text or "").split())


def _first_sentence(text: str | None) -> str:
    return _paragraph(text).split(". ")[0].rstrip(".")


def _spelt(option: Any) -> str:
    """An argument or option as typed in a shell."""
    if not option.opts[0].startswith("-"):
        name = (option.metavar or option.opts[0]).upper()
        return f"`{name.rstrip('.')}{'...' if option.nargs == -1 else ''}`"
    kind = next((word for known, word in _VALUES.items() if known in type(option.type).__name__), "")
    value = "" if option.is_flag else f" {option.metavar or kind or 'VALUE'}"
    return f"`{', '.join((*option.opts, *option.secondary_opts))}{value}`"


def _meaning(option: Any) -> str:
    text = _paragraph(option.help)
    if option.required and option.opts[0].startswith("-"):
        return f"{text} Needed."
    if getattr(option, "is_flag", False) or not option.show_default or option.default in (None, "", [], ()):
        return text
    return f"{text} Default: `{option.default}`."


# effects


def _effects() -> list[str]:
    lines = ["# Effects", _EFFECTS_INTRO, ""]
    places = list(dict.fromkeys(effect.acts_on for effect in EFFECTS.values()))
    rows = []
    for place in places:
        named = (f"[`{name}`](#{name})" for name, effect in EFFECTS.items() if effect.acts_on == place)
        rows.append((place, ", ".join(named)))
    lines += _table(("acts on", f"effects, {len(EFFECTS)} in all"), rows)
    for name, effect in EFFECTS.items():
        drives = "" if {*effect.drives} == {"spring", "force"} else f" With a {' or '.join(effect.drives)} drive only."
        lines += [f"## {name}", "", f"Acts on: {effect.acts_on}.{drives}", ""]
        lines += _table(
            ("form", "formula", "parameters: default, range"),
            (
                (f"`{form}`" if form else "", _code_safe(row.formula), _parameters(row))
                for form, row in effect.forms.items()
            ),
        )
    return lines


def _parameters(form: Formula) -> str:
    described = (
        f"`{row.name}` {_number(row.default)}, {_number(row.low)} to {_number(row.high)}" for row in form.parameters
    )
    return "<br>".join(described)


def _code_safe(formula: str) -> str:
    """A formula with escaped asterisks and underscores."""
    return formula.replace("*", "\\*").replace("_", "\\_").replace("<", "&lt;").replace("|", "&#124;")


# faults


def _faults() -> list[str]:
    explained = json.loads(CliRunner().invoke(cli.app, ["explain", "--json"]).stdout)
    linked = [
        (str(row["exit_status"]), f"[`{row['fault']}`](#{row['fault'].lower()})" if row["fault"] else row["help"])
        for row in explained
        if "exit_status" in row
    ]
    lines = ["# Faults and exit statuses", _FAULTS_INTRO, ""]
    lines += _table(("exit status", "fault or meaning"), linked)
    for kind in FAULTS.values():
        lines += [f"## {kind.code}", "", f"Exit status {kind.exit_status}. {kind.help}", ""]
    lines += ["## Words of a log", "", _WORDS_INTRO, ""]
    lines += _table(
        ("column", "number", "word", "meaning"),
        ([f"`{word.column}`", str(word.number), f"`{word.word}`", word.help] for word in words()),
    )
    lines += ["## Events", "", _EVENTS_INTRO, ""]
    lines += _table(
        ("code", "from", "NE 107", "meaning"),
        ([f"`{event.code}`", event.sources, SEVERITIES[event.letter], event.help] for event in EVENTS.values()),
    )
    lines += ["## Findings of a verdict", "", "Codes that a verdict gives to what it finds in the log itself.", ""]
    lines += _table(
        ("code", "meaning"), ([f"`{row.code}`", f"{SEVERITIES[row.letter]}: {row.help}"] for row in FINDINGS.values())
    )
    return lines


# files


def _programs() -> list[str]:
    """Programs of whose files the tests have an example, with the words that open it, and kinds of files that are not read."""
    opened = {kind.name: shlex.join(kind.options) for kind in files_of_others.KINDS}
    opened |= {kind.file: shlex.join(["--force", kind.columns[1]]) for kind in foreign_tables.KINDS}
    rows = [
        (program, f"`{file}`", f"`{opened[file]}`" if opened[file] else "")
        for file, program in (files_of_others.PROGRAMS | foreign_tables.PROGRAMS).items()
    ]
    foreign = tomllib.loads(FOREIGN.read_text(encoding="utf-8"))["kind"]
    lines = ["# Programs whose files open", _PROGRAMS_INTRO, ""]
    lines += _table(("program", "file of the tests", "words behind `stickslip look FILE`"), sorted(rows))
    lines += ["## Files that are named and not read", "", "`look` prints the name and the command.", ""]
    return lines + _table(
        ("kind", "conversion"), dict.fromkeys((row["name"], f"`{row['convert']}`") for row in foreign)
    )


def _files() -> list[str]:
    lines = ["# Rig, scenario and other files", _FILES_INTRO, ""]
    for title, where, model in _FILES:
        schema = model.model_json_schema()
        lines += [f"## {title}", "", where, ""]
        for path, about, rows in _sections(schema, schema.get("$defs", {}), ""):
            name = f"`[{path}]`" if path and not path.startswith("[") else f"`{path}`" if path else "top of the file"
            lines += [f"### {name}" if path else f"**{name}**", "", *([_paragraph(about), ""] if about else [])]
            lines += _table(("key", "type and range", "default", "meaning"), rows)
    lines += ["## Keys that are gone", "", _GONE_INTRO, ""]
    lines += _table(("key", "replacement"), _gone(Scenario, ""))
    lines += [
        "## Friction pairs",
        "",
        "Values of `pair` in `[rig.contact]`; each fills in the numbers of the table.",
        "",
    ]
    keys = list(dict.fromkeys(key for pair in PAIRS.values() for key in pair))
    lines += _table(
        ("pair", *(f"`{key}`" for key in keys)),
        ([name, *(_number(pair[key]) if key in pair else "" for key in keys)] for name, pair in PAIRS.items()),
    )
    return lines


def _gone(model: type[Strict], path: str) -> Iterator[tuple[str, str]]:
    """Path and successor of every key of older files, of a table and of the tables in it."""
    for key, instead in model.gone.items():
        yield f"`{path}{key}`", instead
    for key, field in model.model_fields.items():
        if isinstance(field.annotation, type) and issubclass(field.annotation, Strict):
            yield from _gone(field.annotation, f"{path}{key}.")


def _sections(schema: dict[str, Any], known: dict[str, Any], path: str) -> Iterator[tuple[str, str, list[list[str]]]]:
    """Path, description and rows of every table of a schema, the outer one first."""
    rows: list[list[str]] = []
    inner: list[tuple[str, dict[str, Any]]] = []
    needed = schema.get("required", [])
    for key, sub in schema.get("properties", {}).items():
        place = f"{path}.{key}" if path else key
        table = _resolved(sub, known)
        item = _resolved(table.get("items", {}), known)
        value = _resolved(table.get("additionalProperties", {}), known) if table.get("type") == "object" else {}
        if "properties" in table:
            inner.append((place, table))
        elif "properties" in item:
            inner.append((f"[[{place}]]", item))
        elif "properties" in value:
            inner.append((f"{place}.NAME", value))
        else:
            default = (
                "needed" if key in needed else f"`{sub['default']}`" if sub.get("default") not in (None, "", {}) else ""
            )
            rows.append([f"`{key}`", _kind(table, known), default, _paragraph(sub.get("description"))])
    if rows:
        yield path, schema.get("description", ""), rows
    for place, table in inner:
        yield from _sections(table, known, place)


def _resolved(schema: Any, known: dict[str, Any]) -> dict[str, Any]:
    """The schema behind a reference or behind a value that may be null."""
    if not isinstance(schema, dict):
        return {}
    if "$ref" in schema:
        return known[schema["$ref"].rpartition("/")[2]]
    choices = [choice for choice in schema.get("anyOf", []) if choice.get("type") != "null"]
    return _resolved(choices[0], known) if len(choices) == 1 else schema


def _kind(schema: dict[str, Any], known: dict[str, Any]) -> str:
    if "const" in schema or "enum" in schema:
        return " or ".join(f"`{value}`" for value in schema.get("enum", [schema.get("const")]))
    if schema.get("type") == "array":
        return (
            "list"
            if "prefixItems" in schema or "items" not in schema
            else f"list of {_kind(_resolved(schema['items'], known), known)}"
        )
    if schema.get("type") == "object":
        return "table"
    low = [f"above {_number(schema['exclusiveMinimum'])}"] if "exclusiveMinimum" in schema else []
    low += [f"from {_number(schema['minimum'])}"] if "minimum" in schema else []
    high = [f"below {_number(schema['exclusiveMaximum'])}"] if "exclusiveMaximum" in schema else []
    high += [f"to {_number(schema['maximum'])}"] if "maximum" in schema else []
    return " ".join((str(schema.get("type", "any value")), *low, *high))


def main() -> None:
    """Write the pages."""
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
    for name, text in zenoh_files.configurations().items():
        (zenoh_files.FOLDER / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
