"""A log in a file, as a drive would write it."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import numpy as np


def written(log: Mapping[str, np.ndarray], folder: Path) -> Path:
    """Times (s), positions (rad) and torques (N·m) as a CSV in that folder."""
    file = folder / "log.csv"
    head = "time [s],position [rad],motor_torque [N·m]"
    np.savetxt(file, np.stack(list(log.values()), axis=1), "%.9f", ",", header=head, comments="")
    return file
