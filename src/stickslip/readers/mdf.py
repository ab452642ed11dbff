"""Read MDF 3 and 4, a format of measurement and calibration tools, by asammdf (LGPL-3.0+, extra `stickslip[mdf]`).

The file is read in a separate process: asammdf is partly compiled, and its half-made objects of a damaged file raise
errors later, when Python deletes them.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.extras import needed
from stickslip.readers import _guard
from stickslip.readers.limits import insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Column, Format, Table


def recognise(head: bytes, path: Path) -> bool:
    """Accept the identification block."""
    return head.startswith((b"MDF     ", b"UnFinMF "))


def read(path: Path) -> Table:
    """Read every numeric channel with its unit and the times of its group."""
    needed("asammdf", "mdf", "MDF files need")
    return _guard.read_apart(_read_here, path, library="asammdf")


def _read_here(path: Path) -> Table:
    library = needed("asammdf", "mdf", "MDF files need")
    columns: list[Column] = []
    count = 0
    try:
        with library.MDF(str(path)) as file:
            for signal in file.iter_channels():
                values: Any = np.asarray(signal.samples)
                if values.dtype.kind in "biuf" and values.ndim == 1 and values.size:
                    count += 2 * values.size
                    insist_on_values(path, count)
                    insist_on_columns(path, len(columns) + 1)
                    clock = np.asarray(signal.timestamps, dtype=np.float64)
                    columns.append(
                        Column(str(signal.name), values.astype(np.float64), str(signal.unit or ""), clock)
                    )
    except (InputError, MemoryError):
        raise
    except Exception as error:  # asammdf raises several types of errors for damaged files
        raise InputError(
            f"{path} cannot be read as MDF ({type(error).__name__}: {error}); export it again"
        ) from None
    return Table("mdf", tuple(columns))


FORMAT = Format("mdf", "MDF 3 and 4", (".mf4", ".mdf", ".dat"), recognise, read, extra="mdf")
