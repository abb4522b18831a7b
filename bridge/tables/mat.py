"""Variables of MATLAB and HDF5 files: vectors, matrices and nested structs."""

import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from bridge.tables.table import ChannelClock, Table

_DEEPEST = 8  # deepest level of nested structs and groups that is read
_MOST_COLUMNS = 4096  # largest number of columns of a matrix that is read; more are a picture
_UNIT_KEYS = ("unit", "units", "Unit", "Units", "unit_string")
_STEP_KEYS, _START_KEYS = (
    ("dt", "wf_increment"),
    ("t0", "wf_start_offset"),
)  # attributes of channels with separate rates
_OF_MATLAB = {"#refs#", "#subsystem#"}  # MATLAB's groups for the targets of references


def read_mat(path: Path) -> Table:
    """Variables of a file of MATLAB v5 to v7, by name: `NAME`, `NAME.FIELD`, `NAME[0]` for elements and columns of a matrix.

    Signals of dSPACE ControlDesk (X and Y with Name, Data, Unit) are listed by their Name as well, each on its raster.
    """
    variables = {name: value for name, value in _loaded(path).items() if not name.startswith("__")}
    return table_of(path, variables)


def table_of(path: Path, variables: dict[str, Any]) -> Table:
    """A table of variables that may hold structs."""
    columns = dict(part for name, value in variables.items() for part in _parts(name, value, 0))
    table = Table(path, columns, names_are_paths=True)
    for name, value in variables.items():
        _add_dspace(table, name, value)
    return table


def _parts(key: str, value: Any, depth: int) -> Iterator[tuple[str, Any]]:
    if depth > _DEEPEST:
        return
    fields = _fields(value)
    if fields is not None:
        for field, inner in fields.items():
            yield from _parts(f"{key}.{field}", inner, depth + 1)
        return
    array = np.atleast_1d(np.asarray(value))
    if array.dtype.kind == "O":
        for i, inner in enumerate(array.ravel()[:_MOST_COLUMNS]):
            yield from _parts(f"{key}[{i}]", inner, depth + 1)
    elif array.ndim == 1:
        yield key, array
    elif array.ndim == 2 and array.shape[1] <= _MOST_COLUMNS:
        if 1 in array.shape:
            yield key, array.ravel()
            return
        for i in range(array.shape[1]):
            yield f"{key}[{i}]", array[:, i]


def _fields(value: Any) -> dict[str, Any] | None:
    if isinstance(value, dict):
        return value
    names = getattr(value, "_fieldnames", None)
    return None if names is None else {name: getattr(value, name) for name in names}


def _add_dspace(table: Table, name: str, value: Any) -> None:
    """Add the signals of a recording of dSPACE by their Name, with their units and the raster of their length."""
    fields = _fields(value)
    if fields is None or not {"X", "Y"} <= fields.keys():
        return
    rasters, signals = _structs(fields["X"]), _structs(fields["Y"])
    times = [(f"{name}.X" + (f"[{i}]" if len(rasters) > 1 else ""), raster) for i, raster in enumerate(rasters)]
    for i, signal in enumerate(signals):
        key = f"{name}.Y[{i}]"
        if "Data" not in signal:
            continue
        data = np.atleast_1d(signal["Data"]).ravel()
        if len(signals) == 1:
            table.columns[f"{key}.Data"] = data
        label = _text(signal.get("Name"))
        keys = [f"{key}.Data", *([label] if label and label not in table.columns else [])]
        table.columns.update(dict.fromkeys(keys, data))
        raster = _raster(signal, rasters)
        for at in keys:
            if unit := _text(signal.get("Unit")):
                table.units[at] = unit
            if raster is not None:
                table.clocks[at] = ChannelClock(0.0, 0.0, raster)
    for key, axis in times:
        if unit := _text(axis.get("Unit")):
            table.units[f"{key}.Data"] = unit


def _raster(signal: dict[str, Any], rasters: list[dict[str, Any]]) -> Any:
    """The instants of a signal [samples]: the raster with as many; None without one."""
    data = [np.atleast_1d(raster["Data"]).ravel().astype(np.float64) for raster in rasters if "Data" in raster]
    length = np.size(signal["Data"])
    return next((times for times in data if len(times) == length), None)


def _structs(value: Any) -> list[dict[str, Any]]:
    if _fields(value) is not None:
        return [_fields(value) or {}]
    structs = (_fields(item) for item in np.atleast_1d(np.asarray(value, object)).ravel())
    return [struct for struct in structs if struct is not None]


def _text(value: Any) -> str:
    if isinstance(value, np.ndarray) and value.size == 1:
        return str(value.item())
    return value if isinstance(value, str) else ""


def _loaded(path: Path) -> dict[str, Any]:
    """The variables of a MATLAB file, read first in a separate process: a damaged file may crash SciPy's compiled reader."""
    import scipy.io

    trial = "import sys, scipy.io; scipy.io.loadmat(sys.argv[1])"
    status = subprocess.run([sys.executable, "-P", "-c", trial, str(path)], capture_output=True, check=False).returncode
    if status < 0:
        raise ValueError(f"it is damaged: its reader was ended by signal {-status}")
    try:
        return scipy.io.loadmat(path, squeeze_me=True, struct_as_record=False)
    except (UnboundLocalError, ArithmeticError, MemoryError) as error:  # an unknown type, or an impossible size
        raise ValueError(f"it is damaged: {error}") from None


def read_hdf5(path: Path) -> Table:
    """Datasets by name, those in groups as `GROUP.NAME`; structs, texts and axes of MATLAB as MATLAB shows them."""
    import h5py

    with h5py.File(path, "r") as file:
        of_matlab = "#refs#" in file or any("MATLAB_class" in file[name].attrs for name in file)
        variables = {name: _value(file, file[name], of_matlab, 0) for name in map(str, file) if name not in _OF_MATLAB}
        table = table_of(path, variables)

        def keep_unit(name: str, item: Any) -> None:
            unit = next((item.attrs[key] for key in _UNIT_KEYS if key in item.attrs), "")
            if isinstance(unit, bytes | str):
                table.units[name.replace("/", ".")] = unit.decode(errors="replace") if isinstance(unit, bytes) else unit
            step_s = next((float(item.attrs[key]) for key in _STEP_KEYS if key in item.attrs), 0.0)
            key = name.replace("/", ".")
            if step_s > 0.0 and key in table.columns:
                start_s = next((float(item.attrs[key]) for key in _START_KEYS if key in item.attrs), 0.0)
                table.clocks[key] = ChannelClock(start_s, step_s)

        file.visititems(keep_unit)
        return table


def _value(file: Any, item: Any, of_matlab: bool, depth: int) -> Any:
    """A group as a dictionary, a dataset as an array, an array of references as a list of their targets."""
    import h5py

    if depth > _DEEPEST:
        return {}
    if isinstance(item, h5py.Group):
        inner = {name: _value(file, item[name], of_matlab, depth + 1) for name in map(str, item)}
        return _of_structs(inner) if of_matlab else inner
    data: Any = item[()]
    if item.dtype == h5py.ref_dtype:
        return _listed([_value(file, file[target], of_matlab, depth + 1) for target in np.ravel(data) if target])
    if item.attrs.get("MATLAB_class", b"") == b"char":
        return "".join(chr(int(code)) for code in np.ravel(data))
    array = np.asarray(data)
    if array.dtype.names:
        return {name: array[name] for name in array.dtype.names}
    if array.dtype.kind == "S":
        return np.char.decode(array, "utf-8", "replace")
    return array.T if of_matlab and array.ndim > 1 else array


def _listed(values: list[Any]) -> Any:
    """Several values as an array of objects, as SciPy gives them."""
    result = np.empty(len(values), object)
    for i, value in enumerate(values):
        result[i] = value
    return result


def _of_structs(fields: dict[str, Any]) -> Any:
    """An array of structs if all fields are arrays of equally many objects; else the struct itself."""
    lengths = {
        len(value) if isinstance(value, np.ndarray) and value.dtype == object else 0 for value in fields.values()
    }
    if len(lengths) != 1 or lengths == {0}:
        return fields
    return _listed([{name: value[i] for name, value in fields.items()} for i in range(lengths.pop())])
