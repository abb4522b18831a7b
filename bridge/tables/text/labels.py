"""Labels between the numbers of a line: `F:14.1,x:3.2` and `t=20 ms  F=14.1 N` of serial ports; cells with commas."""

import re
from collections import Counter
from collections.abc import Sequence

from bridge.tables.cells import is_time

_LABEL = r"""(?<![\w.+:-])["']?([^\W\d][^\s:=,;|"']*)["']?[ \t]*[:=][ \t]*(?=[-+]?\.?\d|nan\b|inf\b)"""
_LABELS = re.compile(_LABEL, re.IGNORECASE)
_WITH_DELIMITER = re.compile(rf"(?:[ \t,;|{{}}]|->)*{_LABEL}", re.IGNORECASE)
_MOST = 0.9  # share of lines that must have the same labels
_MIXED = re.compile(r"[-+.\deE]+(?:(?:[ \t]+|[ \t]*,[ \t]*)[-+.\deE]+)+[ \t]*")


def labels_of(lines: Sequence[str]) -> list[str]:
    """The labels of the numbers, the same in most lines; empty without labels."""
    counted = Counter(tuple(_LABELS.findall(line)) for line in lines if line.strip())
    labels, count = counted.most_common(1)[0] if counted else ((), 0)
    return list(labels) if count > _MOST * sum(counted.values()) and len(set(labels)) == len(labels) else []


def without_labels(text: str, labels: Sequence[str], lines: Sequence[str]) -> tuple[str, tuple[str, ...]]:
    """The text with a tab in place of each label, and the names of its columns; a stamp before the first label is a time."""
    plain = re.sub(r"^\t", "", _WITH_DELIMITER.sub("\t", text), flags=re.MULTILINE)
    before = _WITH_DELIMITER.split(next(line for line in lines if line.strip()), maxsplit=1)[0].strip()
    return plain, (*(("time" if is_time(before) else "1",) if before else ()), *labels)


def is_mixed(lines: Sequence[str]) -> bool:
    """Whether blanks separate the columns, and commas the numbers of one cell: `17.25 0,92 14.1`."""
    filled = [line for line in lines if line.strip()]
    mixed = [line for line in filled if "," in line and " " in line.strip() and _MIXED.fullmatch(line.strip())]
    # with a decimal comma `0,5 14,1` no number has a decimal point
    return len(mixed) > _MOST * len(filled) and all(
        "." in line and re.search(r"\d[ \t]+[-+\d]", line) for line in mixed
    )
