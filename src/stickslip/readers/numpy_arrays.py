"""NumPy's npy and npz files; nothing pickled is ever loaded."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.readers._flatten import table_of
from stickslip.readers.table_columns import Format, Table


def recognise(head: bytes, path: Path) -> bool:
    """The signature of npy, or a zip archive that holds such files."""
    return head.startswith(b"\x93NUMPY") or (
        head.startswith(b"PK") and (b".npy" in head or path.suffix.lower() == ".npz")
    )


def read(path: Path) -> Table:
    """The arrays of the file: structured ones by field, matrices by column."""
    try:
        loaded: Any = np.load(path, allow_pickle=False)
        tree = {k: loaded[k] for k in loaded.files} if hasattr(loaded, "files") else loaded
    except Exception as error:  # NumPy, zip, zlib and the tokenizer of headers each raise their own
        raise InputError(
            f"{path} cannot be read as NumPy arrays ({error}); save plain arrays of numbers, without objects"
        ) from None
    return table_of("numpy", tree)


FORMAT = Format("numpy", "NumPy (npy, npz)", (".npy", ".npz"), recognise, read)
