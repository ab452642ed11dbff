"""HDF5: every numeric dataset; units from its attribute `unit` or `units`.

The file is read in a process of its own: on damaged files the HDF5 library (seen with 2.0) can crash, or step for ever
through a heap of texts, and no check before it short of a second HDF5 library rules that out.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.errors import InputError
from stickslip.readers import _guard
from stickslip.readers._flatten import table_of
from stickslip.readers.table_columns import Column, Format, Table

UNIT_KEYS = ("unit", "units", "Unit", "Units")
MAX_ITEMS = 4000


def recognise(head: bytes, path: Path) -> bool:
    """The signature of HDF5, not in a MAT file's clothes."""
    return head.startswith(b"\x89HDF\r\n\x1a\n")


def read(path: Path) -> Table:
    """Every numeric dataset, named by its path."""
    return read_tree(path, "hdf5", matlab=False)


def read_tree(path: Path, format_name: str, matlab: bool) -> Table:
    """Read the groups of an HDF5 file; `matlab` says that strings are stored as numbers."""
    try:
        return _guard.call(_read_here, path, format_name, matlab, limit=_guard.patience(path))
    except _guard.Died as error:
        raise InputError(
            f"{path} is damaged: the HDF5 library {error}; check that it is complete, or export it again"
        ) from None


def _read_here(path: Path, format_name: str, matlab: bool) -> Table:
    h5py: Any = importlib.import_module("h5py")
    units: dict[str, str] = {}
    try:
        with h5py.File(path, "r") as file:
            tree = _group(h5py, file, "", units, matlab, [0])
    except InputError:
        raise
    except Exception as error:  # h5py passes on whatever the C library says
        raise InputError(
            f"{path} cannot be read as HDF5 ({type(error).__name__}: {error}); check that it is complete"
        ) from None
    table = table_of(format_name, tree)
    columns = tuple(Column(c.name, c.values, units.get(c.name, c.unit), c.clock) for c in table.columns)
    return Table(format_name, columns, table.constants, table.findings)


def _group(
    h5py: Any, group: Any, path: str, units: dict[str, str], matlab: bool, count: list[int]
) -> dict[str, Any]:
    out: dict[str, Any] = {}
    for key in group:
        if matlab and key.startswith("#"):
            continue
        # A broken link is no reason to give up the rest.
        item = group.get(key, None)
        name = f"{path}.{key}" if path else str(key)
        count[0] += 1
        if count[0] > MAX_ITEMS:
            raise InputError(
                f"{group.file.filename} has more than {MAX_ITEMS} groups and datasets; export the signals you need"
            )
        if isinstance(item, h5py.Group):
            if name.count(".") <= 12:
                out[str(key)] = _group(h5py, item, name, units, matlab, count)
        elif isinstance(item, h5py.Dataset):
            out[str(key)] = _dataset(h5py, item, matlab)
            if unit := next((_text(item.attrs[k]) for k in UNIT_KEYS if k in item.attrs), ""):
                units[name] = unit
    for key, value in cast("Mapping[str, Any]", group.attrs).items():
        if (
            np.ndim(value) == 0
            and str(key) not in out
            and not str(key).startswith(("MATLAB", "H5", "CLASS", "TITLE"))
        ):
            out[str(key)] = value if isinstance(value, (str, bytes)) else np.asarray(value)
    return out


def _dataset(h5py: Any, item: Any, matlab: bool) -> Any:
    if item.shape is None:
        return None
    kind = _text(item.attrs["MATLAB_class"]) if matlab and "MATLAB_class" in item.attrs else ""
    if kind == "char":
        return "".join(chr(int(c)) for c in np.asarray(item[()]).T.ravel()[:1000])
    if "MATLAB_empty" in item.attrs:
        return None
    if item.dtype.kind in "biuf" or item.dtype.names:
        return np.asarray(item[()])
    if h5py.check_string_dtype(item.dtype) is not None and item.shape == ():
        return _text(item[()])
    return None


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.ndarray):
        flat = cast("np.ndarray[Any, Any]", value).ravel()
        return _text(flat[0]) if flat.size else ""
    return str(value)


FORMAT = Format("hdf5", "HDF5", (".h5", ".hdf5", ".hdf", ".he5"), recognise, read)
