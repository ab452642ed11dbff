"""Tables of results as Parquet, where the extra `parquet` is installed."""

from __future__ import annotations

import importlib
import importlib.util
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.whole_files import draft_of

Array = np.ndarray[Any, np.dtype[Any]]


def write_parquet(path: Path, parts: Iterable[Mapping[str, Array]]) -> bool:
    """Write a table part by part, or remove an older one if pyarrow is not installed.

    Parameters
    ----------
    path : Path
    parts : iterable of mapping
        Columns by name, the same in each part: texts, integers, truth values, or floats, whose NaN becomes null.

    Returns
    -------
    bool
        Whether it was written.

    Raises
    ------
    InputError
        If the file cannot be written.
    """
    if importlib.util.find_spec("pyarrow") is None:
        path.unlink(missing_ok=True)
        return False
    pyarrow: Any = importlib.import_module("pyarrow")  # Any: it has no types.
    parquet: Any = importlib.import_module("pyarrow.parquet")
    with draft_of(path) as draft:
        writer: Any = None
        try:
            for part in parts:
                columns = [_arrow_column(pyarrow, values) for values in part.values()]
                table = pyarrow.Table.from_arrays(columns, names=list(part))
                writer = writer or parquet.ParquetWriter(draft, table.schema)
                writer.write_table(table)
        finally:
            if writer is not None:
                writer.close()
    return True


def _arrow_column(pyarrow: Any, values: Array) -> Any:
    """Build from buffers, since `pyarrow.array` imports pandas wherever it is installed."""
    if values.dtype.kind == "U":
        encoded = [str(value).encode() for value in values]
        ends = np.cumsum([0, *(len(e) for e in encoded)]).astype(np.int32)
        buffers = [None, pyarrow.py_buffer(ends), pyarrow.py_buffer(b"".join(encoded))]
        return pyarrow.Array.from_buffers(pyarrow.string(), len(values), buffers)
    if values.dtype.kind == "b":
        bits = np.packbits(values, bitorder="little")
        return pyarrow.Array.from_buffers(pyarrow.bool_(), values.size, [None, pyarrow.py_buffer(bits)])
    if values.dtype.kind == "i":
        whole = pyarrow.py_buffer(np.ascontiguousarray(values, dtype=np.int64))
        return pyarrow.Array.from_buffers(pyarrow.int64(), values.size, [None, whole])
    numbers = np.ascontiguousarray(values, dtype=np.float64)
    known = pyarrow.py_buffer(np.packbits(~np.isnan(numbers), bitorder="little"))
    return pyarrow.Array.from_buffers(pyarrow.float64(), numbers.size, [known, pyarrow.py_buffer(numbers)])
