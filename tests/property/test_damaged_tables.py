"""Damaged tables of every format: they are read, or a Fault names the damage; no other exception of a reader escapes."""

from functools import cache
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import scipy.io
from nptdms import ChannelObject, TdmsWriter

from bridge.faults import Fault
from bridge.tables import mat
from bridge.tables.readers import read_table

SUFFIXES = (".csv", ".parquet", ".mat", ".tdms")

MANY = 2500  # of each of the four formats, at night: 10 000 in all


@cache
def sound(suffix: str) -> bytes:
    """A small table of two columns."""
    t_s = np.arange(200) * 1e-3
    columns = {"t_s": t_s, "force_N": np.sin(9.0 * t_s)}
    with TemporaryDirectory() as folder:
        path = Path(folder) / f"table{suffix}"
        if suffix == ".csv":
            path.write_text("t_s,force_N\n" + "".join(f"{a!r},{b!r}\n" for a, b in zip(*columns.values(), strict=True)))
        elif suffix == ".parquet":
            pq.write_table(pa.table(columns), path)
        elif suffix == ".mat":
            scipy.io.savemat(path, {"run": columns}, do_compression=True)
        else:
            with TdmsWriter(path) as writer:
                writer.write_segment([ChannelObject("g", name, values) for name, values in columns.items()])
        return path.read_bytes()


def damaged(data: bytes, random: np.random.Generator) -> bytes:
    """Flipped bits, a cut, a stretch of zeros, noise or another stretch of the file."""
    content = bytearray(data)
    kind = random.integers(5)
    if kind == 0:
        for at in random.integers(len(content), size=random.integers(1, 9)):
            content[at] ^= 1 << random.integers(8)
    elif kind == 1:
        del content[random.integers(len(content)) :]
    else:
        at, length = random.integers(len(content)), random.integers(1, 65)
        end = min(at + length, len(content))
        from_at = random.integers(len(content) - (end - at) + 1)
        other = (bytes(end - at), random.bytes(end - at), bytes(content[from_at : from_at + end - at]))
        content[at:end] = other[kind - 2]
    return bytes(content)


def outcome(path: Path) -> str:
    """`read`, or the code of the fault."""
    try:
        table = read_table(path)
        for name in table.columns:
            table.column(name)
    except Fault as fault:
        return fault.kind.code if path.name in fault.line else fault.line
    return "read"


def check(folder: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, many: int) -> None:
    random = np.random.default_rng(5)
    path = folder / f"damaged{suffix}"
    if suffix == ".mat":
        # without the trial in a separate process, which takes a second
        monkeypatch.setattr(mat, "_loaded", lambda at: scipy.io.loadmat(at, squeeze_me=True, struct_as_record=False))
    for _ in range(many):
        path.write_bytes(damaged(sound(suffix), random))
        assert outcome(path) in {"read", "BAD_TABLE"}


@pytest.mark.parametrize("suffix", SUFFIXES)
def test_a_damaged_table_is_read_or_a_fault(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    check(tmp_path, monkeypatch, suffix, 60)


@pytest.mark.nightly
@pytest.mark.parametrize("suffix", SUFFIXES)
def test_ten_thousand_damaged_tables(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str) -> None:
    check(tmp_path, monkeypatch, suffix, MANY)
