"""Read NumPy's npy and npz files; pickles are never loaded."""

from __future__ import annotations

import math
import zipfile
from pathlib import Path
from typing import IO, Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.readers._flatten import table_of
from stickslip.readers.limits import insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Format, Table

NPY = b"\x93NUMPY"


def recognise(head: bytes, path: Path) -> bool:
    """Accept the signature of npy, or a zip archive of such files."""
    return head.startswith(NPY) or (
        head.startswith(b"PK") and (b".npy" in head or path.suffix.lower() == ".npz")
    )


def read(path: Path) -> Table:
    """Read the arrays of the file: structured ones by field, matrices by column."""
    try:
        insist_on_arrays(path)
        loaded: Any = np.load(path, allow_pickle=False)
        tree = {k: loaded[k] for k in loaded.files} if hasattr(loaded, "files") else loaded
    except InputError:
        raise
    except Exception as error:  # NumPy, zip, zlib and the parser of headers each raise their own errors
        raise InputError(
            f"{path} cannot be read as NumPy arrays ({error}); save plain arrays of numbers, without objects"
        ) from None
    return table_of("numpy", tree, path)


def insist_on_arrays(path: Path) -> None:
    """Refuse too many arrays or values, by the headers of the arrays alone.

    Raises
    ------
    InputError
    """
    with path.open("rb") as file:
        if file.read(len(NPY)) == NPY:
            file.seek(0)
            insist_on_values(path, _values(file))
            return
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        insist_on_columns(path, len(members))
        count = 0
        for member in members:
            with archive.open(member) as file:
                count += _values(file)
            insist_on_values(path, count)


def _values(file: IO[bytes]) -> int:
    """Return the number of values of the array that starts here, 0 if none does. A string of n characters counts as
    n."""
    if file.read(len(NPY)) != NPY:
        return 0
    major, _ = file.read(2)
    form: Any = np.lib.format
    shape, _, kind = (form.read_array_header_1_0 if major == 1 else form.read_array_header_2_0)(file)
    return math.prod(shape) * max(1, len(kind.names or ()), 0 if kind.names else kind.itemsize // 8)


FORMAT = Format("numpy", "NumPy (npy, npz)", (".npy", ".npz"), recognise, read)
