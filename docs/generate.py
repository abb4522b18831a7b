"""Pages of docs/reference that are made from the code: `make reference` writes them, tests/unit/test_docs.py compares them."""

import inspect
import json
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import Any

import typer.main
from typer.testing import CliRunner

from bridge.config import Strict
from bridge.faults import FAULTS
from bridge.wire.event_codes import EVENTS, LETTERS
from bridge.wire.words import words
from cockpit import cli
from cockpit.run.scenario import Scenario
from diagnosis.evidence.import_table import ImportMap
from diagnosis.evidence.manifest import Manifest
from docs import constants, zenoh_files
from plant.effects.library import EFFECTS
from plant.effects.row import Form
from plant.pairs import PAIRS

FOLDER = Path(__file__).parent / "reference"
_MADE = "<!-- Made by `make reference`; change the code instead. -->\n"
_SYMBOLS = """\
Symbols: `F_c`, `F_s` Coulomb and static friction; `v_s` Stribeck velocity; `v_r` velocity in the contact; `x` position of
the slide; `s_e` where the drive would be without ripple; `e` extension of the drive's spring; `k_d`, `h_d` stiffness and
damping of the drive; `F_d` drive force; `F_f` friction; `age` time at rest; `t` time of the run; `f` frequency of the
vibration; `w(a) = sin a + second_sin sin 2a + second_cos cos 2a`, `a` with the phase."""
_EFFECTS_INTRO = f"""\
What a real rig does and the ideal rig does not. An effect is a mechanism, a form is one formula for it. Each is off unless a
rig file has its table `[effects.NAME]`, with `form` (the first one if left out) and the form's parameters; off is
bit-identical to the ideal rig. The diagnosis tries every form of every effect. `tests/truth/test_effects_*` holds each
formula against a closed form or SciPy.

{_SYMBOLS}"""
_FAULTS_INTRO = (
    "`stickslip explain CODE` prints the same, and `stickslip explain WORD` a [word of a log](#words-of-a-log)."
)
_WORDS_INTRO = """\
What the numbers of the columns `mode`, `state`, `reason` and `limit` of a log and of its tables mean.
`stickslip explain reason` prints a column, `stickslip explain PIEZO_WEAK` a word."""
_LETTERS_SAID = "; ".join(f"{letter}, {said}" for letter, said in LETTERS.items() if letter)
_EVENTS_INTRO = f"""\
What plant, controller and recorder say on the bus and in a log. The letter is that of NAMUR NE 107: {_LETTERS_SAID}.
A run with an event of letter F is not good. `stickslip explain GAP` prints one, `stickslip explain event` all of them."""
_FILES_INTRO = """\
Keys of the TOML files, with their defaults and ranges. A misspelt key or a value out of range is an error that names file,
key, rule and remedy. Units are in the names."""
_GONE_INTRO = """\
Keys of older scenarios. They are still read, so that an old file works, and do nothing: a line on stderr says what holds
instead."""
_FILES: tuple[tuple[str, str, type[Strict]], ...] = (
    (
        "Scenario",
        "`deploy/scenarios/*.toml`, `--scenario FILE`. The keys below `rig` are also those of a rig file.",
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
    return {name: "\n".join((title, "", _MADE, *lines, "")) for name, (title, *lines) in made.items()}


def _constants() -> list[str]:
    rows = dict(constants.sections())
    numbers = [row for own in rows.values() for row in own]
    lines = [
        "# Constants of the diagnosis",
        f"The diagnosis decides by {len(numbers)} numbers in {len({row[1] for row in numbers})} files of `diagnosis/`. Where no"
        " count is named, the number follows from what is said of it, or is a step of the computation.", "",
    ]  # fmt: skip
    for room, own in rows.items():
        lines += [f"## {room}", "", *_table(("constant", "file", "value", "what it does", "counted in"), own)]
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
    found = list(_walk(root, "stickslip"))
    rows = [(f"[`{name}`](#{name.replace(' ', '-')})", _first_sentence(command.help)) for name, command in found]
    lines = ["# Commands", *_table(("command", "what it does"), rows)]
    for name, command in found:
        lines += [f"## {name}", "", _paragraph(command.help), ""]
        options = [one for one in command.params if not getattr(one, "hidden", False) and not one.is_eager]
        if options:
            lines += _table(("argument or option", "what it does"), ((_spelt(one), _meaning(one)) for one in options))
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


def _spelt(one: Any) -> str:
    """An argument or option as it is typed."""
    if not one.opts[0].startswith("-"):
        name = (one.metavar or one.opts[0]).upper()
        return f"`{name.rstrip('.')}{'...' if one.nargs == -1 else ''}`"
    kind = next((word for known, word in _VALUES.items() if known in type(one.type).__name__), "")
    value = "" if one.is_flag else f" {one.metavar or kind or 'VALUE'}"
    return f"`{', '.join((*one.opts, *one.secondary_opts))}{value}`"


def _meaning(one: Any) -> str:
    told = _paragraph(one.help)
    if one.required and one.opts[0].startswith("-"):
        return f"{told} Needed."
    if getattr(one, "is_flag", False) or not one.show_default or one.default in (None, "", [], ()):
        return told
    return f"{told} Default: `{one.default}`."


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
            ("form", "what it does", "parameters: default, range"),
            (
                (f"`{form}`" if form else "", _code_safe(told.formula), _parameters(told))
                for form, told in effect.forms.items()
            ),
        )
    return lines


def _parameters(form: Form) -> str:
    told = (
        f"`{one.name}` {_number(one.default)}, {_number(one.low)} to {_number(one.high)}" for one in form.parameters
    )
    return "<br>".join(told)


def _code_safe(formula: str) -> str:
    """A formula whose asterisks and underscores are no emphasis."""
    return formula.replace("*", "\\*").replace("_", "\\_").replace("<", "&lt;").replace("|", "&#124;")


# faults


def _faults() -> list[str]:
    told = json.loads(CliRunner().invoke(cli.app, ["explain", "--json"]).stdout)
    linked = [
        (str(one["exit_status"]), f"[`{one['fault']}`](#{one['fault'].lower()})" if one["fault"] else one["help"])
        for one in told
        if "exit_status" in one
    ]
    lines = ["# Faults and exit statuses", _FAULTS_INTRO, ""]
    lines += _table(("exit status", "fault or meaning"), linked)
    for kind in FAULTS.values():
        lines += [f"## {kind.code}", "", f"Exit status {kind.exit_status}. {kind.help}", ""]
    lines += ["## Words of a log", "", _WORDS_INTRO, ""]
    lines += _table(
        ("column", "number", "word", "meaning"),
        ([f"`{one.column}`", str(one.number), f"`{one.word}`", one.help] for one in words()),
    )
    lines += ["## Events", "", _EVENTS_INTRO, ""]
    lines += _table(
        ("code", "from", "NE 107", "meaning"),
        ([f"`{one.code}`", one.sources, one.letter, one.help] for one in EVENTS.values()),
    )
    return lines


# files


def _files() -> list[str]:
    lines = ["# Rig, scenario and other files", _FILES_INTRO, ""]
    for title, where, model in _FILES:
        schema = model.model_json_schema()
        lines += [f"## {title}", "", where, ""]
        for path, told, rows in _sections(schema, schema.get("$defs", {}), ""):
            name = f"`[{path}]`" if path and not path.startswith("[") else f"`{path}`" if path else "top of the file"
            lines += [f"### {name}" if path else f"**{name}**", "", *([_paragraph(told), ""] if told else [])]
            lines += _table(("key", "type and range", "default", "meaning"), rows)
    lines += ["## Keys that are gone", "", _GONE_INTRO, ""]
    lines += _table(("key", "what holds instead"), _gone(Scenario, ""))
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
    for key, one in schema.get("properties", {}).items():
        here = f"{path}.{key}" if path else key
        table = _resolved(one, known)
        item = _resolved(table.get("items", {}), known)
        value = _resolved(table.get("additionalProperties", {}), known) if table.get("type") == "object" else {}
        if "properties" in table:
            inner.append((here, table))
        elif "properties" in item:
            inner.append((f"[[{here}]]", item))
        elif "properties" in value:
            inner.append((f"{here}.NAME", value))
        else:
            default = (
                "needed" if key in needed else f"`{one['default']}`" if one.get("default") not in (None, "", {}) else ""
            )
            rows.append([f"`{key}`", _kind(table, known), default, _paragraph(one.get("description"))])
    if rows:
        yield path, schema.get("description", ""), rows
    for here, table in inner:
        yield from _sections(table, known, here)


def _resolved(one: Any, known: dict[str, Any]) -> dict[str, Any]:
    """What a schema stands for: of a reference its target, of a value or nothing the value."""
    if not isinstance(one, dict):
        return {}
    if "$ref" in one:
        return known[one["$ref"].rpartition("/")[2]]
    choices = [choice for choice in one.get("anyOf", []) if choice.get("type") != "null"]
    return _resolved(choices[0], known) if len(choices) == 1 else one


def _kind(one: dict[str, Any], known: dict[str, Any]) -> str:
    if "const" in one or "enum" in one:
        return " or ".join(f"`{value}`" for value in one.get("enum", [one.get("const")]))
    if one.get("type") == "array":
        return (
            "list"
            if "prefixItems" in one or "items" not in one
            else f"list of {_kind(_resolved(one['items'], known), known)}"
        )
    if one.get("type") == "object":
        return "table"
    low = [f"above {_number(one['exclusiveMinimum'])}"] if "exclusiveMinimum" in one else []
    low += [f"from {_number(one['minimum'])}"] if "minimum" in one else []
    high = [f"below {_number(one['exclusiveMaximum'])}"] if "exclusiveMaximum" in one else []
    high += [f"to {_number(one['maximum'])}"] if "maximum" in one else []
    return " ".join((str(one.get("type", "any value")), *low, *high))


def main() -> None:
    """Write the pages."""
    for name, text in pages().items():
        (FOLDER / name).write_text(text, encoding="utf-8")
    for name, text in zenoh_files.configurations().items():
        (zenoh_files.FOLDER / name).write_text(text, encoding="utf-8")


if __name__ == "__main__":
    main()
