"""The torque over the angle that a source of `export` holds."""

from __future__ import annotations

import os
from pathlib import Path

from stickslip.core.config import read_toml
from stickslip.core.errors import InputError
from stickslip.machines.position_map import PositionMap
from stickslip.models.model import refuse_unknown_keys
from stickslip.verbs.identification import IdentificationResult
from stickslip.verbs.kinds import kind_of, require


def only_map(source: object) -> bool:
    """Whether a source holds a torque over the angle and no law."""
    if isinstance(source, IdentificationResult):
        return source.identification.model is None and source.position_map is not None
    if isinstance(source, PositionMap):
        return True
    return isinstance(source, (str, os.PathLike)) and kind_of(Path(source)) == "map"  # type: ignore[reportUnknownArgumentType]


def map_in(source: object, target: str) -> PositionMap:
    """The torque over the angle that a source holds.

    Raises
    ------
    InputError
        If it holds none; the message names the target.
    """
    found: PositionMap | None = None
    if isinstance(source, PositionMap):
        found = source
    elif isinstance(source, IdentificationResult):
        found = source.position_map
    elif isinstance(source, (str, os.PathLike)):
        path = Path(source)  # type: ignore[reportUnknownArgumentType]
        require(path, "map", "model")
        whole = read_toml(path)
        if not whole.has("law"):
            refuse_unknown_keys(whole)
        if whole.has("position_map"):
            found = PositionMap.of(whole.table("position_map").values)
    if found is None:
        raise InputError(
            f"{target}: this source has no torque over the angle; `stickslip identify LOG --method cogging` makes one"
        )
    return found
