"""Parquet files; units from the field's metadata (`unit` or `units`)."""

from __future__ import annotations

import importlib
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.errors import InputError
from stickslip.finding import Finding
from stickslip.readers.table_columns import Column, Format, Table


def recognise(head: bytes, path: Path) -> bool:
    """Its signature."""
    return head.startswith(b"PAR1")


def read(path: Path) -> Table:
    """Every column of numbers, truth values or times; nulls become NaN."""
    parquet: Any = importlib.import_module("pyarrow.parquet")
    pa: Any = importlib.import_module("pyarrow")
    try:
        table: Any = parquet.read_table(path)
        columns: list[Column] = []
        findings: list[Finding] = []
        unread: dict[str, str] = {}
        for field in table.schema:
            values = _numbers(pa, table.column(field.name), field.type)
            if values is None:
                findings.append(
                    Finding(
                        "note",
                        "not-read",
                        f"column {field.name!r} holds {field.type}, not numbers; it was left out",
                    )
                )
                unread[str(field.name)] = str(table.column(field.name)[0])[:30] if table.num_rows else ""
                continue
            meta: dict[bytes, bytes] = field.metadata or {}
            unit = (meta.get(b"unit") or meta.get(b"units") or b"").decode("utf-8", "replace")
            columns.append(Column(str(field.name), values, "s" if pa.types.is_temporal(field.type) else unit))
    except Exception as error:  # Arrow raises its own, OSError, ValueError, ...
        raise InputError(
            f"{path} cannot be read as Parquet ({type(error).__name__}: {error}); check that it is complete"
        ) from None
    return Table("parquet", tuple(columns), findings=tuple(findings), unread=unread)


def _numbers(pa: Any, column: Any, kind: Any) -> np.ndarray[Any, np.dtype[np.float64]] | None:
    """A column as floats; times in s."""
    types = pa.types
    if types.is_timestamp(kind) or types.is_duration(kind) or types.is_time(kind):
        scale = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
        whole = pa.int32() if types.is_time32(kind) else pa.int64()
        return (
            np.asarray(column.cast(whole).cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64) * scale
        )
    if types.is_boolean(kind):
        column = column.cast(pa.int8())
    elif not (types.is_integer(kind) or types.is_floating(kind) or types.is_decimal(kind)):
        return None
    return np.array(column.cast(pa.float64(), safe=False).to_numpy(), dtype=np.float64)


FORMAT = Format("parquet", "Parquet", (".parquet", ".pq"), recognise, read)
