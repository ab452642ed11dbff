"""A rig with tighter limits than its own: plans, checks and the loop use only these."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Any, cast

import numpy as np

from stickslip.core.errors import InputError, suggestion
from stickslip.rigs.loop_sample import Control
from stickslip.rigs.rig import BlockRig, Capabilities, Limits, Measurement, Rig

Array = np.ndarray[Any, np.dtype[np.float64]]

LIMITS = (
    "torque", "speed", "lowest_position", "highest_position", "temperature", "following_error", "stop_time",
    "answer_time", "standstill_torque",
)  # fmt: skip
"""Names of the limits, as in a rig's file"""


class Limited:
    """A rig with other limits; everything else is the rig's.

    Parameters
    ----------
    rig : Rig
    limits : Limits
        Not wider than the rig's.

    Raises
    ------
    InputError
    """

    def __init__(self, rig: Rig, limits: Limits) -> None:
        self._rig = rig
        self._limits = rig.limits.narrowed(limits)

    @property
    def limits(self) -> Limits:
        """The tighter limits."""
        return self._limits

    @property
    def name(self) -> str:
        """The rig's."""
        return self._rig.name

    @property
    def sample_time(self) -> float:
        """s"""
        return self._rig.sample_time

    @property
    def capabilities(self) -> Capabilities:
        """The rig's."""
        return self._rig.capabilities

    def open(self) -> Measurement:
        """As the rig."""
        return self._rig.open()

    def exchange(self, torque: float) -> Measurement:
        """As the rig."""
        return self._rig.exchange(torque)

    def exchange_block(self, control: Control, setpoints: Array, rows: Array) -> int:
        """As the rig, if `Capabilities.blocks` is true."""
        return cast(BlockRig, self._rig).exchange_block(control, setpoints, rows)

    def pause(self, seconds: float) -> Measurement:
        """As the rig."""
        return self._rig.pause(seconds)

    def close(self) -> None:
        """As the rig."""
        self._rig.close()

    def __getattr__(self, name: str) -> Any:
        # All other attributes (such as a virtual rig's machine) are the rig's.
        return getattr(self._rig, name)


def limited(rig: Rig, values: Mapping[str, float]) -> Rig:
    """Return the rig with these limits by name (`LIMITS`); the rig itself without any.

    Raises
    ------
    InputError
        For an unknown name, or a limit that is out of bounds or wider than the rig's.
    """
    if not values:
        return rig
    changed = dict(values)
    for name in changed:
        if name not in LIMITS:
            raise InputError(f"no limit {name!r}; {suggestion(name, LIMITS)}")
    low, high = rig.limits.position
    position = (changed.pop("lowest_position", low), changed.pop("highest_position", high))
    return Limited(rig, replace(rig.limits, position=position, **changed))
