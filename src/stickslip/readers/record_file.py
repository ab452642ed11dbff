"""Read the package's own records: channels with their units, and meta."""

from __future__ import annotations

import zipfile
from pathlib import Path
from typing import cast

from stickslip.core.errors import InputError
from stickslip.core.record import Record
from stickslip.core.stream_file import MAGIC
from stickslip.readers.numpy_arrays import insist_on_arrays
from stickslip.readers.table_columns import Column, Format, Table


def recognise(head: bytes, path: Path) -> bool:
    """Accept a zip archive with the header of `Record.save`, or a rig's stream."""
    if head.startswith(MAGIC):
        return True
    if not head.startswith(b"PK"):
        return False
    try:
        with zipfile.ZipFile(path) as archive:
            return "__header__.npy" in archive.namelist()
    except (OSError, zipfile.BadZipFile, ValueError, NotImplementedError):
        return False


def read(path: Path) -> Table:
    """Read time and channels with their units."""
    with path.open("rb") as file:
        packed = file.read(len(MAGIC)) != MAGIC
    if packed:
        try:
            insist_on_arrays(path)
        except InputError:
            raise
        except Exception as error:  # zip, zlib and NumPy each raise their own errors for damaged files
            raise InputError(f"{path} is not a record of this package ({error})") from None
    record = Record.load(path)
    columns = [Column("time", record.time, "s")]
    columns += [Column(name, record[name], record.units[name]) for name in record.channels]
    constants: dict[str, float | str] = {
        k: v
        for k, v in cast("dict[str, object]", dict(record.meta)).items()
        if isinstance(v, (str, float, int))
    }
    return Table("record", tuple(columns), constants)


FORMAT = Format("record", "a record of this package", (".npz", ".stream"), recognise, read)
