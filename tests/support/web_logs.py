"""The example's log in the shapes in which people have theirs."""

from __future__ import annotations

import csv
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import scipy.io

from support.serving import DEMO

__all__ = ["LOGS", "as_it_is", "german", "matlab"]


def as_it_is(folder: Path) -> Path:
    """The log that ships."""
    return Path(shutil.copyfile(DEMO, folder / "demo.csv"))


def german(folder: Path) -> Path:
    """The same as a German spreadsheet saves it: semicolons, decimal commas, umlauts in Latin-1."""
    rows = list(csv.reader(DEMO.open(encoding="utf-8")))
    lines = [";".join(["Zeit [s]", "Istposition [rad]", "Drehmoment [Nm]", "Sollposition [rad]"])]
    lines += [";".join(cell.replace(".", ",") for cell in row) for row in rows[1:]]
    (folder / "Messung für Achse.csv").write_bytes("\r\n".join(lines).encode("latin-1"))
    return folder / "Messung für Achse.csv"


def matlab(folder: Path) -> Path:
    """The same as MATLAB saves it."""
    values = np.array(list(csv.reader(DEMO.open(encoding="utf-8")))[1:], dtype=float)
    names = ("time", "position", "torque", "position_reference")
    scipy.io.savemat(folder / "run.mat", {n: values[:, [i]] for i, n in enumerate(names)})
    return folder / "run.mat"


LOGS: dict[str, Callable[[Path], Path]] = {
    "CSV": as_it_is,
    "German CSV with decimal commas": german,
    "MAT file": matlab,
}
