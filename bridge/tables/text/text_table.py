"""The rows of a text table as columns. Arrow reads them, after a conversion of forms that it does not support."""

import re
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.csv as pa_csv

from bridge.faults import Fault
from bridge.log.finding import Finding
from bridge.tables.cells import starts_of, texts_of
from bridge.tables.pieces import Segment
from bridge.tables.table import Table
from bridge.tables.text.dialect import BLANK, Dialect, TextLayout, form_of
from bridge.tables.text.encoding import decoded
from bridge.tables.text.head import COMMENTS, Head, read_head
from bridge.tables.text.labels import is_mixed, labels_of, without_labels
from bridge.tables.text.unit_cells import units_apart
from bridge.units import counted

# While reading a CSV file, Arrow handles Ctrl-C and SIGTERM itself, and loses a signal near the end.
pa.enable_signal_handlers(False)

_HEAD_CHARACTERS = 1 << 18  # part of the file in which the rows must begin; LabVIEW and DIAdem write 10 kB above
_PIECES, _PIECE_CHARACTERS = 12, 4096  # samples of the rest, from which the form of the rows is detected
_MOST_LEFT_OUT = 0.1  # share of rows with too many or too few cells above which the file is refused
# a quoted name over several lines, as spreadsheets write a cell with line breaks; other quotes may be inch marks
_NAME_OF_LINES = re.compile(r'(?:^|(?<=[,;\t|]))"[^"\r\n]{0,80}[\r\n][^"]{0,80}"(?=[,;\t|\r\n]|\Z)', re.MULTILINE)
# signs of word processors in place of the ASCII minus: U+2212, a dash, and the full-width minus
_MINUS = ("\u2212", "\u2013", "\uff0d")
_MINUS_OF_NUMBER = re.compile(rf'(?<![^\n\r;,\t |"eE])[{"".join(_MINUS)}](?=[\d.,])')
_SHOWN = 60  # longest part of a line that a finding shows [characters]


def read_text(path: Path, given: Dialect) -> Table:
    """Read a text table; properties missing in `given` are detected and reported as findings. Raises Fault BAD_TABLE."""
    before = given
    text, encoding = decoded(path.read_bytes(), given.encoding, path.name)
    if any(minus in text for minus in _MINUS):
        text = _MINUS_OF_NUMBER.sub("-", text)
    top = text[:_HEAD_CHARACTERS]
    if '"' in top:
        text = _NAME_OF_LINES.sub(lambda name: re.sub(r"\s+", " ", name[0]), top) + text[_HEAD_CHARACTERS:]
    head_lines = text[:_HEAD_CHARACTERS].splitlines()
    if not any(line.strip() for line in head_lines):
        raise Fault("BAD_TABLE", f"{path.name}: is empty; give a file with rows")
    body = _spread(text, head_lines, given)
    if labels := labels_of(body):
        text, names = without_labels(text, labels, body)
        given = given._replace(delimiter="\t", names=given.names or names)
    elif given.delimiter is None and is_mixed(body):
        given = given._replace(delimiter=BLANK, decimal=".")
    if given is not before:
        head_lines = text[:_HEAD_CHARACTERS].splitlines()
        body = _spread(text, head_lines, given)
    form = form_of(body, given, any('"' in line for line in (*head_lines, *body)), head_lines)
    head = read_head(head_lines, body, form, given, path.name)
    rows, lost, segments = _pieces(text, head, form, given)
    columns: dict[str, Any] = {name: rows.column(i) for i, name in enumerate(head.names)}
    findings = [*_assumed(path.name, head, form, encoding, before), *_lost(path.name, lost, rows.num_rows)]
    units = head.unit_of
    columns = _named_by_words(columns) if head.names_line < 0 and given.names is None else columns
    for name, column in columns.items():
        texts = texts_of(column.to_numpy()) if pa.types.is_string(column.type) else []
        if texts and (apart := units_apart(texts, form.decimal, form.thousands)):
            columns[name], units[name] = np.array(apart[0]), apart[1]
            findings.append(Finding("assumed", path.name, f"column {name} has the unit {apart[1]} in its cells"))
    written: dict[str, Any] = {"delimiter": form.delimiter, "decimal": form.decimal, "encoding": encoding}
    written |= {"thousands": form.thousands} if form.thousands else {}
    written |= {"names": head.names} if head.names_line < 0 else {"skip_rows": head.names_line}
    return Table(
        path,
        columns,
        units=units,
        sample_rate_Hz=1.0 / head.step_s if head.step_s else None,
        decimal=form.decimal,
        thousands=form.thousands,
        findings=findings,
        written=written,
        segments=segments,
    )


def _spread(text: str, head_lines: list[str], given: Dialect) -> list[str]:
    """Complete lines of rows, sampled from the whole file."""
    if len(text) <= _HEAD_CHARACTERS:
        filled = [
            line for line in head_lines if line.strip() and not line.lstrip().startswith(given.comment or COMMENTS)
        ]
        # without the beginning, which may hold titles; at least two lines, as the last may be no row
        return filled[max(len(filled) // 3, min(len(filled) - 2, 60)) :] if len(filled) > 3 else filled[-1:]
    lines: list[str] = []
    for piece in range(1, _PIECES + 1):
        at = len(text) * piece // (_PIECES + 1)
        lines += text[at : at + _PIECE_CHARACTERS].splitlines()[1:-1]
    return lines


def _pieces(text: str, head: Head, form: TextLayout, given: Dialect) -> tuple[Any, list[str], tuple[Segment, ...]]:
    """The rows of all pieces as one Arrow table, the other lines, and the pieces where the line of names repeats."""
    # the lines of the head end as `read_text` splits them
    lines = text[:_HEAD_CHARACTERS].splitlines(keepends=True)
    begin = sum(map(len, lines[: head.lines]))
    names = lines[head.names_line].strip("\r\n") if head.names_line >= 0 else ""
    # `find` is ten times as fast as a pattern, and most files have one head
    again = text.find(f"\n{names}", begin) >= 0 if names else False
    repeats = [match.start() for match in re.finditer(rf"^{re.escape(names)}\r?$", text[begin:], re.M)] if again else []
    if not repeats or repeats[0] == 0:
        rows, lost = _rows(text[begin:], head, form, given)
        return rows, lost, ()
    stamps, ends, begins = ["".join(lines[: head.lines])], [], [begin]
    for repeat in repeats:
        above = text[begins[-1] : begin + repeat].splitlines(keepends=True)
        inner = next((n for n, line in enumerate(reversed(above)) if head.is_row(line, form)), len(above))
        ends.append(begin + repeat - sum(map(len, above[len(above) - inner :])))
        below = text[begin + repeat : begin + repeat + _HEAD_CHARACTERS].splitlines(keepends=True)
        under = next((n for n, line in enumerate(below) if head.is_row(line, form)), len(below))
        begins.append(begin + repeat + sum(map(len, below[:under])))
        stamps.append(text[ends[-1] : begins[-1]])
    read = [_rows(text[at:end], head, form, given) for at, end in zip(begins, [*ends, len(text)], strict=True)]
    filled = [(*part, start_s) for part, start_s in zip(read, starts_of(stamps), strict=True) if part[0].num_rows]
    tables = [table for table, _, _ in filled] or [read[0][0]]
    first_rows = np.cumsum([0, *(table.num_rows for table in tables)]).tolist()
    segments = tuple(Segment(row, start_s) for row, (_, _, start_s) in zip(first_rows, filled, strict=False))
    whole = pa.concat_tables(tables, promote_options="permissive")
    return whole, [line for _, lost in read for line in lost], segments


def _rows(rows: str, head: Head, form: TextLayout, given: Dialect) -> tuple[Any, list[str]]:
    """The rows as an Arrow table, and the lines with another number of cells, which are left out."""
    delimiter = form.delimiter
    if given.comment or any(mark[0] in rows and f"\n{mark}" in rows for mark in COMMENTS):
        marks = tuple([given.comment] if given.comment else COMMENTS)
        rows = "\n".join(line for line in rows.splitlines() if not line.lstrip().startswith(marks))
    if delimiter == BLANK:
        rows = re.sub(r"[ \t]+", "\t", re.sub(r"^[ \t]+|[ \t]+$", "", rows, flags=re.MULTILINE))
        delimiter = "\t"
    lost: list[str] = []

    def skip(row: Any) -> str:
        lost.append(row.text)
        return "skip"

    def read(text: str) -> Any:
        return pa_csv.read_csv(
            pa.BufferReader(text.encode()),
            read_options=pa_csv.ReadOptions(column_names=head.names, use_threads=True),
            parse_options=pa_csv.ParseOptions(
                delimiter=delimiter, quote_char=form.quote or False, invalid_row_handler=skip
            ),
            convert_options=pa_csv.ConvertOptions(decimal_point=form.decimal, strings_can_be_null=True),
        )

    table = read(rows)
    if len(lost) > _MOST_LEFT_OUT * (table.num_rows + len(lost)) and all(
        line.count(delimiter) < len(head.names) and form.is_number(line.split(delimiter)[0]) for line in lost
    ):  # channels that end sooner leave shorter rows
        lost.clear()
        cells = len(head.names) - 1
        table = read(
            "\n".join(line + delimiter * (cells - line.count(delimiter)) for line in rows.splitlines() if line.strip())
        )
    return table, lost


def _named_by_words(columns: dict[str, Any]) -> dict[str, Any]:
    """The columns, each named by a column of one repeated word before it: `force +14.1 position +3.2`."""
    result: dict[str, Any] = {}
    word = ""
    for name, column in columns.items():
        result[word if word and word not in columns and word not in result else name] = column
        words = column.unique() if pa.types.is_string(column.type) else []
        word = str(words[0]).strip(" :=") if len(words) == 1 and words[0].is_valid else ""
    return result


def _assumed(file: str, head: Head, form: TextLayout, encoding: str, given: Dialect) -> list[Finding]:
    """Findings for detected properties that the map does not state and that are not the usual ones."""
    findings: list[Finding] = []
    parts = [
        (given.delimiter is None and form.delimiter != ",", f"delimiter = {form.delimiter!r}"),
        (given.decimal is None and form.decimal != ".", f"decimal = {form.decimal!r}"),
        (given.thousands is None and bool(form.thousands), f"thousands = {form.thousands!r}"),
        (given.encoding is None and encoding != "utf-8", f"encoding = {encoding!r}"),
        (given.skip_rows is None and head.names_line > 0, f"skip_rows = {head.names_line}"),
        (given.names is None and head.names_line < 0, "no line of names: columns are numbered"),
    ]
    if texts := [text for wanted, text in parts if wanted]:
        findings.append(Finding("assumed", file, ", ".join(texts)))
    return findings + head.unit_findings(file)


def _lost(file: str, lost: list[str], rows: int) -> list[Finding]:
    if not lost:
        return []
    text = f"{counted(len(lost), 'line')} with another number of cells left out, first {lost[0][:_SHOWN]!r}"
    if len(lost) > _MOST_LEFT_OUT * (rows + len(lost)):
        raise Fault(
            "BAD_TABLE", f"{file}: {text}, of {rows + len(lost)}: must be few; cut the file, or state source.delimiter"
        )
    return [Finding("cut", file, text, len(lost))]
