"""Read HDF5: every numeric dataset; units from its attribute `unit` or `units`.

The file is read in a separate process: on damaged files the HDF5 library (2.0) can crash or loop forever, and only a
second HDF5 library could check for this in advance.
"""

from __future__ import annotations

import importlib
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.readers import _guard
from stickslip.readers._flatten import table_of
from stickslip.readers.limits import insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Format, Table

UNIT_KEYS = ("unit", "units", "Unit", "Units")


def recognise(head: bytes, path: Path) -> bool:
    """Accept the signature of HDF5, but not MAT files."""
    return head.startswith(b"\x89HDF\r\n\x1a\n")


def read(path: Path) -> Table:
    """Read every numeric dataset, named by its path."""
    return read_tree(path, "hdf5", matlab=False)


def read_tree(path: Path, format_name: str, matlab: bool) -> Table:
    """Read the groups of an HDF5 file; with `matlab` strings are stored as numbers."""
    return _guard.read_apart(_read_here, path, format_name, matlab, library="the HDF5 library")


def _read_here(path: Path, format_name: str, matlab: bool) -> Table:
    h5py: Any = importlib.import_module("h5py")
    try:
        with h5py.File(path, "r") as file:
            reading = _Reading(h5py, path, matlab)
            tree = reading.group(file, "")
    except (InputError, MemoryError):
        raise
    except Exception as error:  # h5py passes on any error of the C library
        raise InputError(
            f"{path} cannot be read as HDF5 ({type(error).__name__}: {error}); check that it is complete"
        ) from None
    table = table_of(format_name, tree, path, findings=reading.findings)
    columns = tuple(replace(c, unit=reading.units.get(c.name, c.unit)) for c in table.columns)
    return replace(table, columns=columns)


class _Reading:
    """Reads the groups of a file; links to other files are not followed."""

    def __init__(self, h5py: Any, path: Path, matlab: bool) -> None:
        self.h5py, self.path, self.matlab = h5py, path, matlab
        self.units: dict[str, str] = {}
        self.findings: list[Finding] = []
        self._within: set[int] = set()
        """Addresses of the parent groups of the current one."""
        self._items = 0
        self._values = 0

    def group(self, group: Any, path: str) -> dict[str, Any]:
        """Return datasets, groups and attributes of a group, by name."""
        h5py = self.h5py
        out: dict[str, Any] = {}
        self._items += len(group)
        insist_on_columns(self.path, self._items)
        address = h5py.h5o.get_info(group.id).addr
        self._within.add(address)
        for key in group:
            if self.matlab and key.startswith("#"):
                continue
            name = f"{path}.{key}" if path else str(key)
            link = group.get(key, getlink=True)
            if isinstance(link, h5py.ExternalLink):
                self._elsewhere(name, str(link.filename))
                continue
            # A broken link does not prevent reading the rest.
            item = group.get(key, None)
            if isinstance(item, h5py.Group):
                # A link to a parent group adds nothing.
                if name.count(".") <= 12 and h5py.h5o.get_info(item.id).addr not in self._within:
                    out[str(key)] = self.group(item, name)
            elif isinstance(item, h5py.Dataset):
                out[str(key)] = self._dataset(item, name)
                if unit := next((_text(item.attrs[k]) for k in UNIT_KEYS if k in item.attrs), ""):
                    self.units[name] = unit
        self._within.discard(address)
        for key, value in cast("Mapping[str, Any]", group.attrs).items():
            if (
                np.ndim(value) == 0
                and str(key) not in out
                and not str(key).startswith(("MATLAB", "H5", "CLASS", "TITLE"))
            ):
                out[str(key)] = value if isinstance(value, (str, bytes)) else np.asarray(value)
        return out

    def _dataset(self, item: Any, name: str) -> Any:
        if item.shape is None:
            return None
        files = [str(source[0]) for source in item.external or ()]
        if item.is_virtual:
            files += [str(source.file_name) for source in item.virtual_sources() if source.file_name != "."]
        if files:
            return self._elsewhere(name, files[0])
        self._values += item.size * max(1, len(item.dtype.names or ()))
        insist_on_values(self.path, self._values)
        kind = _text(item.attrs["MATLAB_class"]) if self.matlab and "MATLAB_class" in item.attrs else ""
        if kind == "char":
            return "".join(chr(int(c)) for c in np.asarray(item[()]).T.ravel()[:1000])
        if "MATLAB_empty" in item.attrs:
            return None
        if item.dtype.kind in "biuf" or item.dtype.names:
            return np.asarray(item[()])
        if self.h5py.check_string_dtype(item.dtype) is not None and item.shape == ():
            return _text(item[()])
        return None

    def _elsewhere(self, name: str, file: str) -> None:
        """Report data that are stored in another file."""
        message = f"{name!r} is stored in another file, {file!r}, which is not opened; it was left out"
        remedy = "copy the data into one file (h5repack, or h5py's Group.copy with expand_external)"
        self.findings.append(Finding("warning", "not-read", message, remedy=remedy))


def _text(value: Any) -> str:
    if isinstance(value, bytes):
        return value.decode("utf-8", "replace")
    if isinstance(value, np.ndarray):
        flat = cast("np.ndarray[Any, Any]", value).ravel()
        return _text(flat[0]) if flat.size else ""
    return str(value)


FORMAT = Format("hdf5", "HDF5", (".h5", ".hdf5", ".hdf", ".he5"), recognise, read)
