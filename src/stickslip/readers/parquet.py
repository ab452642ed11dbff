"""Read Parquet files (extra `stickslip[parquet]`); units from the field's metadata (`unit` or `units`).

A column of lists of equal length, such as the joints of a robot, becomes a column for each element: ``state[0]``.
Columns of other types are not loaded.
"""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.extras import needed
from stickslip.core.finding import Finding
from stickslip.readers.limits import insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Array, Column, Format, Table


def recognise(head: bytes, path: Path) -> bool:
    """Accept its signature."""
    return head.startswith(b"PAR1")


def read(path: Path) -> Table:
    """Read every column of numbers, truth values, times or lists of numbers; nulls become NaN."""
    parquet, pa = (
        needed(module, "parquet", "Parquet files need") for module in ("pyarrow.parquet", "pyarrow")
    )
    try:
        with parquet.ParquetFile(path) as file:
            return _read(pa, file, path)
    except InputError:
        raise
    except Exception as error:  # Arrow raises its own errors, OSError, ValueError, ...
        raise InputError(
            f"{path} cannot be read as Parquet ({type(error).__name__}: {error}); check that it is complete"
        ) from None


def _read(pa: Any, file: Any, path: Path) -> Table:
    schema: Any = file.schema_arrow
    insist_on_columns(path, len(schema))
    known = [str(field.name) for field in schema if _is_known(pa, _element(pa, field.type))]
    _insist_on_size(path, file.metadata, {*known})
    table: Any = file.read(columns=known)
    columns: list[Column] = []
    findings: list[Finding] = []
    unread: dict[str, str] = {}
    for field in schema:
        name = str(field.name)
        parts = _parts(pa, table.column(name), field.type) if name in known else []
        if not parts:
            what = "lists of different lengths" if name in known else f"{field.type}, not numbers"
            findings.append(Finding("note", "not-read", f"column {name!r} holds {what}; it was left out"))
            unread[name] = ""
        meta: dict[bytes, bytes] = field.metadata or {}
        unit = (meta.get(b"unit") or meta.get(b"units") or b"").decode("utf-8", "replace")
        unit = "s" if pa.types.is_temporal(field.type) else unit
        columns += [Column(name + suffix, values, unit) for suffix, values in parts]
        insist_on_columns(path, len(columns))
    return Table("parquet", tuple(columns), findings=tuple(findings), unread=unread)


def _insist_on_size(path: Path, metadata: Any, names: set[str]) -> None:
    """Refuse too many values, by the counts that the file declares, because repeated values take no space."""
    count = 0
    for i in range(metadata.num_row_groups):
        group = metadata.row_group(i)
        for j in range(group.num_columns):
            leaf = group.column(j)
            if str(leaf.path_in_schema) in names or _root(str(leaf.path_in_schema), names):
                count += max(int(leaf.num_values), int(group.num_rows))
    insist_on_values(path, count)


def _root(path: str, names: set[str]) -> bool:
    """Whether a leaf such as ``observation.state.list.element`` belongs to one of the columns."""
    return any(path.startswith(f"{name}.") for name in names)


def _element(pa: Any, kind: Any) -> Any:
    """Return the type of the values of a list, else the type itself."""
    types = pa.types
    if types.is_list(kind) or types.is_large_list(kind) or types.is_fixed_size_list(kind):
        return kind.value_type
    return kind


def _is_known(pa: Any, kind: Any) -> bool:
    types = pa.types
    return (
        types.is_timestamp(kind) or types.is_duration(kind) or types.is_time(kind) or types.is_boolean(kind)
        or types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind)
    )  # fmt: skip


def _parts(pa: Any, column: Any, kind: Any) -> list[tuple[str, Array]]:
    """Return a column's numbers, for lists of equal length those of each element; nothing if the lengths differ."""
    element = _element(pa, kind)
    if element is kind:
        return [("", _numbers(pa, column, kind))]
    compute: Any = importlib.import_module("pyarrow.compute")
    lengths = compute.unique(compute.list_value_length(column)).drop_null().to_pylist()
    if len(lengths) != 1 or not lengths[0]:
        return []
    width = int(lengths[0])
    values = _numbers(pa, compute.list_flatten(column), element)
    rows = np.full((len(column), width), np.nan)
    rows[np.asarray(column.is_valid())] = values.reshape(-1, width)
    return [(f"[{i}]", np.ascontiguousarray(rows[:, i])) for i in range(width)]


def _numbers(pa: Any, column: Any, kind: Any) -> Array:
    """Return a column as floats, times in s."""
    types = pa.types
    if types.is_timestamp(kind) or types.is_duration(kind) or types.is_time(kind):
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        whole = pa.int32() if types.is_time32(kind) else pa.int64()
        return (
            np.asarray(column.cast(whole).cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64) * scale
        )
    if types.is_boolean(kind):
        column = column.cast(pa.int8())
    return np.array(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)


FORMAT = Format("parquet", "Parquet", (".parquet", ".pq"), recognise, read)
