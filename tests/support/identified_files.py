"""Models as an identification writes them, with estimates of a chosen accuracy."""

from __future__ import annotations

import tomllib
from pathlib import Path

import numpy as np
import tomli_w

from stickslip import Model
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.model_file import write_model
from stickslip.identification.motion import sinusoid

STRIBECK = {"k": 50.0, "fs": 0.335, "fc": 0.285, "vs": 0.1, "sigma2": 0.018}


UNITS = {"k": "N·m·s/rad", "fs": "N·m", "fc": "N·m", "vs": "rad/s", "sigma2": "N·m·s/rad"}


def written(path: Path, relative: float = 0.01, law: str = "stribeck", **values: float) -> Path:
    """A model whose estimates have that relative standard deviation."""
    found = {k: v for k, v in {**STRIBECK, **values}.items() if law == "stribeck" or k in ("fc", "sigma2")}
    estimates = tuple(
        Estimate(n, UNITS[n], n, v, relative * v, v * np.exp(-1.96 * relative), v * np.exp(1.96 * relative), True)
        for n, v in found.items()
    )  # fmt: skip
    result = Identification("axis", Model(law, **found), estimates, np.eye(len(estimates)), {})
    write_model(path, result, data=[{"file": path.name, "sha256": path.name, "rows": 9}])
    content = tomllib.loads(path.read_text(encoding="utf-8"))
    content["axis"] = {"inertia": 4e-4, "offset": 0.03}
    content["trajectory"] = sinusoid(0.1, 0.5).table()
    path.write_text(tomli_w.dumps(content), encoding="utf-8")
    return path
