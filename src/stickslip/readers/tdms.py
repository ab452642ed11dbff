"""Read TDMS, LabVIEW's format, by npTDMS (LGPL-3.0, extra `stickslip[tdms]`)."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.extras import needed
from stickslip.readers.limits import insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Column, Format, Table


def recognise(head: bytes, path: Path) -> bool:
    """Accept the tag of a segment."""
    return head.startswith(b"TDSm")


def read(path: Path) -> Table:
    """Read every numeric channel with its unit and, for a waveform, its times."""
    library = needed("nptdms", "tdms", "TDMS files need")
    columns: list[Column] = []
    try:
        with library.TdmsFile.open(path) as file:
            channels: list[Any] = [channel for group in file.groups() for channel in group.channels()]
            insist_on_columns(path, len(channels))
            insist_on_values(path, sum(len(channel) for channel in channels))
            for channel in channels:
                values: Any = np.asarray(channel[:])
                if values.dtype.kind in "biuf" and values.size:
                    unit = str(channel.properties.get("unit_string", ""))
                    columns.append(
                        Column(
                            str(channel.name), values.astype(np.float64), unit, _clock(channel, values.size)
                        )
                    )
    except InputError:
        raise
    except Exception as error:  # npTDMS raises several types of errors for damaged files
        raise InputError(
            f"{path} cannot be read as TDMS ({type(error).__name__}: {error}); export it again"
        ) from None
    return Table("tdms", tuple(columns))


def _clock(channel: Any, count: int) -> Any:
    """Return the times of a waveform in s from its start; None for plain data."""
    step = channel.properties.get("wf_increment")
    if step is None or not float(step) > 0.0:
        return None
    return float(channel.properties.get("wf_start_offset", 0.0)) + np.arange(count) * float(step)


FORMAT = Format("tdms", "TDMS (LabVIEW)", (".tdms",), recognise, read, extra="tdms")
