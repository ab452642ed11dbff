"""LuGre's sigma0 and sigma1 from a stick-slip response (`stickslip.identification.presliding.lugre_dynamics`)."""

from __future__ import annotations

from collections.abc import Sequence

from stickslip.core.errors import InputError
from stickslip.core.messages import name_option, name_parameter
from stickslip.core.record import Record
from stickslip.identification.estimate import Identification
from stickslip.identification.methods._records import (
    has_torque,
    known_curve,
    single,
    with_torque,
    without_constant_torque,
)
from stickslip.identification.methods.method import TORQUE, Method, Options
from stickslip.identification.presliding.lugre_dynamics import Response, identify_lugre_dynamics

OWN = ("inertia", "offset")
"""Values that do not belong to the sliding curve."""


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Identify sigma0 and sigma1 from one response; the inertia is among the values."""
    record = single(records, "lugre")
    if "inertia" not in options.values:
        raise InputError(
            f"{name_option('method', 'lugre')} needs the inertia in kg·m²; give {name_parameter('inertia')}"
        )
    curve = known_curve(options, "lugre", OWN)
    (record,), channel = with_torque([record], options, "lugre")
    response = Response.of(without_constant_torque(record, channel, options), channel)
    return identify_lugre_dynamics(response, options.values["inertia"], curve, noise=options.noise)


METHOD = Method(
    "lugre",
    "LuGre's stiffness and damping from stick-slip",
    identify,
    has_torque("lugre"),
    uses=TORQUE | {"values", "inertia", "model", "noise"},
)
