"""From the keys of a controller's table that are its short form to gains and a compensator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from stickslip.control.compensator import COMPENSATORS, Compensator
from stickslip.control.linear import LINEAR, Cascade, Gains, place
from stickslip.core.config import Table
from stickslip.core.errors import ConfigError
from stickslip.models.model import Model

OF_GAINS = ("linear", "gains", "cascade")
"""Keys of which one says the linear part."""
OF_COMPENSATOR = ("law", "gain", "filter_hz", "lead", "deadband", "offset", "inertia_feedforward", "substeps")


@dataclass(frozen=True)
class Placement:
    """Where the poles of the loop without friction lie."""

    bandwidth: float
    """Natural frequency, Hz"""
    damping: float
    """Damping ratio of the pair"""


def placement(table: Table) -> Placement | None:
    """Read ``placement = {bandwidth_hz, damping}``, if it is there."""
    if not table.has("placement"):
        return None
    with table.table("placement") as poles:
        return Placement(poles.positive("bandwidth_hz", "Hz"), poles.positive("damping", ""))


def gains_in(table: Table, inertia: float, poles: Placement | None) -> Gains | Cascade:
    """The gains: ``linear`` and where the `poles` lie, or ``gains``, or ``cascade``."""
    if table.has("cascade"):
        for other in ("gains", "linear", "placement"):
            if table.has(other):
                raise ConfigError(
                    f"{table.label()}: cascade and {other} exclude each other; give one of them"
                )
        with table.table("cascade") as given:
            return Cascade(
                given.number("kv", "1/s", lower=0.0), given.number("kvp", "N·m·s/rad", lower=0.0),
                given.number("kvi", "N·m/rad", 0.0, lower=0.0), given.number("feed", "", 1.0, lower=0.0),
            )  # fmt: skip
    if table.has("gains"):
        if table.has("linear") or table.has("placement"):
            raise ConfigError(f"{table.label()}: gains and linear exclude each other; give one of them")
        with table.table("gains") as gains:
            kp = gains.number("kp", "N·m/rad", lower=0.0)
            ki = gains.number("ki", "N·m/(rad·s)", 0.0, lower=0.0)
            kd = gains.number("kd", "N·m·s/rad", 0.0, lower=0.0)
            return Gains(kp, ki, kd, gains.number("kr", "N·m·s/rad", 0.0, lower=0.0))
    kind = table.choice("linear", LINEAR)
    if poles is None:
        raise ConfigError(
            f"{table.label('placement')} is missing; give {{bandwidth_hz = ..., damping = ...}}"
        )
    return place(kind, inertia, poles.bandwidth, poles.damping)


def compensator_in(table: Table, laws: Mapping[str, Model]) -> Compensator | None:
    """The compensator, ``compensator``, ``law`` and its numbers, if there is one."""
    if not table.has("compensator"):
        for key in OF_COMPENSATOR:
            if key in table.values:
                table.choice("compensator", COMPENSATORS)
        return None
    kind = COMPENSATORS[table.choice("compensator", COMPENSATORS)]
    law = laws[table.choice("law", laws, family="laws")]
    gain = table.number("gain", "", 1.0)
    corner = table.positive("filter_hz", "Hz") if table.has("filter_hz") else None
    parts = table.number("substeps", "", 1.0, lower=1.0)
    if not parts.is_integer():
        raise table.error("substeps", "must be a whole number")
    return kind(
        law, gain, corner, table.number("lead", "s", 0.0), table.number("deadband", "rad/s", 0.0),
        table.number("offset", "N·m", 0.0), table.number("inertia_feedforward", "kg·m²", 0.0),
        int(parts),
    )  # fmt: skip
