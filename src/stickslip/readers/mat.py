"""Read MATLAB files: versions 5 to 7.2 by SciPy, version 7.3 (which is HDF5) by h5py."""

from __future__ import annotations

import importlib
import warnings
from collections.abc import Mapping
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.finding import Finding
from stickslip.readers import _mat_check, hdf5
from stickslip.readers._flatten import table_of
from stickslip.readers.limits import insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Format, Table


def recognise(head: bytes, path: Path) -> bool:
    """Accept the text at the start of both versions; version 4 is recognised by its suffix."""
    return head.startswith(b"MATLAB") or (path.suffix.lower() == ".mat" and not head.startswith(b"\x89HDF"))


def read(path: Path) -> Table:
    """Read every numeric variable and field of a structure, with names joined by dots."""
    with path.open("rb") as file:
        head = file.read(1024)
    if head.startswith(b"MATLAB 7.3") or b"\x89HDF" in head:
        return hdf5.read_tree(path, "mat", matlab=True)
    loadmat: Any = importlib.import_module("scipy.io").loadmat
    try:
        if 0 not in head[:4]:  # version 4 has no header text, and SciPy reads it without compiled code
            variables = _mat_check.check(path.read_bytes(), lambda count: insist_on_values(path, count))
            insist_on_columns(path, variables)
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            loaded = cast("Mapping[str, Any]", loadmat(path, simplify_cells=True))
    except InputError:
        raise
    except Exception as error:  # SciPy raises a dozen types of errors for damaged files
        raise InputError(f"{path} is no MAT file that can be read ({type(error).__name__}: {error}); "
                         "save it again with `save file.mat -v7`") from None  # fmt: skip
    tree = {k: v for k, v in loaded.items() if not k.startswith("__") and not _opaque(v)}
    findings = [
        Finding("warning", "not-read", f"{k!r} is a MATLAB object, which cannot be read",
                remedy="save its numbers as arrays, such as `t = ts.Time; q = ts.Data`")
        for k, v in loaded.items() if not k.startswith("__") and _opaque(v)
    ]  # fmt: skip
    if "__function_workspace__" in loaded and not findings:
        findings.append(Finding("warning", "not-read", "the file holds MATLAB objects, which cannot be read",
                                remedy="save their numbers as arrays"))  # fmt: skip
    return table_of("mat", tree, path, findings=findings)


def _opaque(value: Any) -> bool:
    if isinstance(value, np.ndarray):
        fields = cast("np.ndarray[Any, Any]", value).dtype.names
        return fields is not None and "arr" in fields
    return type(value).__name__ in ("MatlabOpaque", "MatlabFunction")


FORMAT = Format("mat", "MATLAB (v5 to v7.3)", (".mat",), recognise, read)
