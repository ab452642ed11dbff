"""Read ROS bags: ROS 1 files, ROS 2 folders and single MCAP files, by rosbags (Apache-2.0, extra `stickslip[rosbag]`).

Every numeric field of every topic becomes a column TOPIC.FIELD; the elements of an array that has names, as in
sensor_msgs/JointState, use these. Times are those of the message's header, else of its arrival.
"""

from __future__ import annotations

import os
import re
from array import array
from pathlib import Path
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError
from stickslip.core.extras import needed
from stickslip.readers import _guard
from stickslip.readers.limits import insist_on_columns, insist_on_values
from stickslip.readers.table_columns import Column, Format, Table

MAX_ELEMENTS = 64
CHECKED = 100_000
"""Count of numbers after which memory is checked again."""
LISTED = re.compile(r"""["']?([^\s"'\[\],]+\.(?:db3|mcap|zstd))\b""")
"""The files named in metadata.yaml."""


def recognise(head: bytes, path: Path) -> bool:
    """Accept a folder with metadata.yaml, or the signature of ROS 1 or MCAP."""
    return (path.is_dir() and (path / "metadata.yaml").is_file()) or head.startswith(
        (b"#ROSBAG V", b"\x89MCAP0\r\n")
    )


def read(path: Path) -> Table:
    """Read the numeric fields of every topic, with their times."""
    if path.is_dir():
        _insist_on_own_files(path)
    needed("rosbags.highlevel", "rosbag", "ROS bags need")
    return _guard.read_apart(_read_here, path, library="rosbags")


def _insist_on_own_files(folder: Path) -> None:
    """Refuse a bag with a file outside its folder, through a link or a path in metadata.yaml.

    Raises
    ------
    InputError
    """
    home = Path(os.path.realpath(folder))
    listed = LISTED.findall((folder / "metadata.yaml").read_text(encoding="utf-8", errors="replace"))
    names = [*listed, *(p.name for p in folder.iterdir())]
    for name in names:
        if not Path(os.path.realpath(folder / name)).is_relative_to(home):
            raise InputError(
                f"{folder}: the bag's file {name!r} is outside its folder and is not opened; copy it into the folder"
            )


def _read_here(path: Path) -> Table:
    library = needed("rosbags.highlevel", "rosbag", "ROS bags need")
    stores = needed("rosbags.typesys", "rosbag", "ROS bags need")
    samples: dict[str, tuple[array[float], array[float]]] = {}
    count = checked = 0
    try:
        store = stores.get_typestore(stores.Stores.LATEST)
        with library.AnyReader([path], default_typestore=store) as reader:
            for connection, stamp, raw in reader.messages():
                message = reader.deserialize(raw, connection.msgtype)
                time = _time(message, stamp)
                for name, value in _fields(message, connection.topic).items():
                    times, values = samples.setdefault(name, (array("d"), array("d")))
                    times.append(time)
                    values.append(value)
                    count += 2
                insist_on_columns(path, len(samples))
                if count >= checked + CHECKED:
                    insist_on_values(path, count)
                    checked = count
    except (InputError, MemoryError):
        raise
    except Exception as error:  # rosbags raises several types of errors for damaged bags
        raise InputError(
            f"{path} cannot be read as a ROS bag ({type(error).__name__}: {error}); check that it is complete"
        ) from None
    columns = [
        Column(name, np.array(values), "", np.array(times)) for name, (times, values) in samples.items()
    ]
    return Table("rosbag", tuple(columns))


def _time(message: Any, stamp: int) -> float:
    """Return the header's time in s, if it is set."""
    header = getattr(getattr(message, "header", None), "stamp", None)
    told = float(header.sec) + 1e-9 * float(header.nanosec) if header is not None else 0.0
    return told if told > 0.0 else 1e-9 * stamp


def _fields(message: Any, name: str, depth: int = 0) -> dict[str, float]:
    """Return the numbers in a message, by path."""
    out: dict[str, float] = {}
    fields: dict[str, Any] = getattr(message, "__dataclass_fields__", {})
    labels: Any = getattr(message, "name", ())
    for key in fields:
        if key in ("header", "__msgtype__") or depth > 4:
            continue
        value: Any = getattr(message, key)
        if isinstance(value, (bool, int, float, np.number)):
            out[f"{name}.{key}"] = float(cast("Any", value))
        elif isinstance(value, np.ndarray):
            out |= _elements(cast("np.ndarray[Any, Any]", value), f"{name}.{key}", labels)
        else:
            out |= _fields(value, f"{name}.{key}", depth + 1)
    return out


def _elements(values: np.ndarray[Any, Any], name: str, labels: Any) -> dict[str, float]:
    """Return the numbers of a short array, by label if each has one, else by index."""
    if not 0 < values.size <= MAX_ELEMENTS or values.dtype.kind not in "biuf":
        return {}
    named = not isinstance(labels, str) and len(labels) == values.size
    numbers = values.ravel().astype(float).tolist()
    return {f"{name}.{labels[i]}" if named else f"{name}[{i}]": number for i, number in enumerate(numbers)}


FORMAT = Format("rosbag", "ROS bag, MCAP", (".bag", ".mcap", ".db3"), recognise, read, extra="rosbag")
