"""model.toml: an identified law with its axis, intervals, correlation and the records it comes from.

`stickslip.models.model.Model.from_file` reads the law back; a study or simulation names it by
``law = {model = "model.toml"}``. Numbers are in SI units; those of a linear axis in N and m.
"""

from __future__ import annotations

import importlib.metadata
import math
import os
import platform
import tomllib
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.core.config import Document, Table
from stickslip.core.errors import InputError
from stickslip.core.whole_files import write_whole
from stickslip.identification.estimate import Estimate, Identification
from stickslip.identification.sliding import SlidingPosterior
from stickslip.identification.train import two_inertias
from stickslip.machines.angle import AngleMap
from stickslip.machines.position_map import PositionMap
from stickslip.machines.servo import ServoAxis
from stickslip.machines.two_inertias import TwoInertias
from stickslip.models.model import MODEL_FORMAT, Model


def write_model(
    path: str | os.PathLike[str],
    found: Identification,
    *,
    data: Sequence[Mapping[str, Any]] = (),
    law: str = "",
    more: Mapping[str, Any] | None = None,
) -> Path:
    """Write an identified law.

    Parameters
    ----------
    path : path
        Path of the file, usually ``model.toml``.
    found : Identification
    data : sequence of mapping
        One per record: ``file``, ``sha256``, ``rows`` and other known data.
    law : str
        Path of the law's file, if the law is not found by its name.
    more : mapping, optional
        Further tables; their ``axis`` is merged into the axis's table.

    Raises
    ------
    InputError
        If there is neither a law nor a map over the angle, or the file cannot be written.
    """
    import tomli_w

    target = Path(path)
    return write_whole(target, tomli_w.dumps(model_content(found, data, _relative(law, target), more)))


def model_content(
    found: Identification, data: Sequence[Mapping[str, Any]], law: str = "", more: Mapping[str, Any] | None = None
) -> dict[str, Any]:  # fmt: skip
    """Return all that `write_model` writes, as plain data; `law` is written as given."""
    content, further = model_data(found, data, law), dict(more or {})
    axis = content.get("axis", {}) | dict(further.get("axis", {}))
    return content | further | ({"axis": axis} if axis else {})


def in_memory(content: Mapping[str, Any]) -> Table:
    """Return the table that reading such a file gives, without a file; the law's path must be absolute."""
    import tomli_w

    return Table(tomllib.loads(tomli_w.dumps(content)), Document("model.toml", Path()))


def _relative(law: str, target: Path) -> str:
    """Return the path of a law's file relative to the model's folder."""
    if not law.endswith(".py"):
        return law
    return Path(
        os.path.relpath(Path(os.path.realpath(law)), Path(os.path.realpath(target)).parent)
    ).as_posix()


def model_data(found: Identification, data: Sequence[Mapping[str, Any]], law: str = "") -> dict[str, Any]:
    """Return the content of the file as plain data."""
    the_map: Any = found.details.get("map")
    if found.model is None and not isinstance(the_map, PositionMap):
        raise InputError(f"{found.method} yields no whole law, so there is no model to write")
    axis: Any = found.details.get("axis")
    out: dict[str, Any] = {
        "format": MODEL_FORMAT,
        "method": found.method,
        "motion": axis.motion if isinstance(axis, ServoAxis) else "rotary",
        "notes": list(found.notes),
        "measure_next": list(found.measure_next),
    }
    if found.model is not None:
        out |= _law(found.model, law)
    if isinstance(the_map, PositionMap):
        out["position_map"] = the_map.as_dict()
    mechanics: Any = found.details.get("mechanics")
    if mechanics is not None:
        out["axis"] = {
            k: float(getattr(mechanics, k))
            for k in ("inertia", "offset", "gravity", "gravity_angle", "drive_gain", "back_emf", "load_motor",
                      "load_external", "backlash")
        }  # fmt: skip
    elif "constant_torque" in found.details:
        out["axis"] = {"offset": float(found.details["constant_torque"])}
    if isinstance(axis, ServoAxis):
        out["axis"] = out.get("axis", {}) | {"seen_from": axis.seen_from, "gear_ratio": axis.gear_ratio}
    train = told_train(found)
    if train is not None:
        out["drivetrain"] = train.as_dict()
    angle: Any = found.details.get("angle")
    if isinstance(angle, AngleMap):
        out["angle"] = angle.as_dict()
    out["misfit"] = {k: float(v) for k, v in found.misfit.items() if math.isfinite(v)}
    out["estimates"] = [_estimate(e) for e in found.estimates]
    out["assumed"] = dict(found.assumed)
    out["correlation"] = {
        "names": [e.name for e in found.estimates],
        "matrix": np.where(np.isfinite(found.correlation), found.correlation, math.nan).round(6).tolist(),
    }
    out["data"] = [dict(d) for d in data]
    out["versions"] = versions()
    return out


def told_train(found: Identification) -> TwoInertias | None:
    """Return motor and load behind a spring, if the records determined them."""
    sliding: Any = found.details.get("sliding")
    return two_inertias(sliding) if isinstance(sliding, SlidingPosterior) else None


def _law(model: Model, law: str) -> dict[str, Any]:
    """Return the law's name, parameters and choices."""
    plain = model.as_dict()
    names = {f.name for f in model.law.fields}
    choices = {k: v for k, v in plain.items() if k not in names and k != "law"}
    out = {"law": law or model.law.name, "parameters": {k: v for k, v in plain.items() if k in names}}
    return out | ({"choices": choices} if choices else {})


def _estimate(e: Estimate) -> dict[str, Any]:
    """Return an estimate as a TOML table; TOML has inf and nan, so every number stays one."""
    return {
        "name": e.name, "unit": e.unit, "value": float(e.value), "std": float(e.std), "lower": float(e.lower),
        "upper": float(e.upper), "identified": bool(e.identified), **({"verdict": e.verdict} if e.verdict else {}),
    }  # fmt: skip


def versions() -> dict[str, str]:
    """Return the versions of all software that affects the numbers."""
    import stickslip

    found = {"stickslip": stickslip.__version__, "python": platform.python_version()}
    return found | {n: importlib.metadata.version(n) for n in ("numpy", "scipy", "numba")}
