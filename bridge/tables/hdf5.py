"""MATLAB files of version 7.3, and other HDF5 files, as variables."""

from pathlib import Path
from typing import Any

import numpy as np

from bridge.tables.mat import table_of
from bridge.tables.table import Table

_DEEPEST = 8  # deepest level of nested groups that is read
_UNIT_KEYS = ("unit", "units", "Unit", "Units", "unit_string")
_OF_MATLAB = {"#refs#", "#subsystem#"}  # MATLAB's groups for the targets of references


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
