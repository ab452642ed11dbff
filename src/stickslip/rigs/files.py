"""Read rigs from TOML files: ``[rig]`` has the kind and its settings, ``[rig.limits]`` the limits.

The kind is the name of a registered one, or the path of a file with ``RIG = RigKind(...)``.

[rig]
kind = "ds402"
bus = {interface = "socketcan", channel = "can0"}
node = 1

[rig.limits]
torque = 1.2          # N·m
speed = 30.0          # rad/s
"""

from __future__ import annotations

import math
import os
from collections.abc import Callable
from pathlib import Path

from stickslip.core.config import Table, read_toml
from stickslip.core.errors import InputError, StickslipError
from stickslip.rigs.declared import checked
from stickslip.rigs.kinds import rig_kind, rig_kind_names
from stickslip.rigs.rig import Limits, Rig, RigKind


def read_rig(path: str | os.PathLike[str]) -> Rig:
    """Return the rig of the TOML file at `path`, not yet open.

    Raises
    ------
    ConfigError
        Names the wrong key and the allowed values.
    CodeRefused
        If its kind is code that is not approved.
    """
    with read_toml(Path(path)) as document, document.table("rig") as table:
        name = table.text("kind")
        if name.endswith(".py"):
            kind = rig_kind(str(table.document.locate(name)), table.label("kind"))
        else:
            kind = rig_kind(table.choice("kind", rig_kind_names()))
        if not isinstance(kind, RigKind):  # type: ignore[reportUnnecessaryIsInstance]
            raise InputError(f"{name}: RIG = {kind!r} is no `RigKind(name, build, title)`")
        with table.blamed():
            return checked(_built(name, kind.build, table))


def _built(name: str, build: Callable[[Table], Rig], table: Table) -> Rig:
    try:
        return build(table)
    except StickslipError:
        raise
    except Exception as error:
        raise InputError(f"rig {name}: build raised {type(error).__name__}: {error}; correct it") from error


def limits_in(table: Table, default: Limits | None = None) -> Limits:
    """The table's ``limits``; keys that are missing are those of `default`, or no limit.

    Raises
    ------
    ConfigError
        If a torque or speed is missing and there is no default, or a value is out of bounds.
    """
    if not table.has("limits") and default is not None:
        return default
    with table.table("limits") as t, t.blamed():
        low, high = default.position if default else (-math.inf, math.inf)
        return Limits(
            torque=t.positive("torque", "N·m", default.torque if default else None),
            speed=t.positive("speed", "rad/s", default.speed if default else None),
            position=(
                t.number("lowest_position", "rad", low),
                t.number("highest_position", "rad", high),
            ),
            temperature=t.number("temperature", "°C", default.temperature if default else math.inf),
            following_error=t.positive(
                "following_error", "rad", default.following_error if default else math.inf
            ),
            stop_time=t.positive("stop_time", "s", default.stop_time if default else Limits.stop_time),
            answer_time=t.positive(
                "answer_time", "s", default.answer_time if default else Limits.answer_time
            ),
            standstill_torque=(
                t.positive("standstill_torque", "N·m")
                if t.has("standstill_torque")
                else (default or Limits).standstill_torque
            ),
        )
