"""The compensator on a model that `export` writes: what is asked for, or what a file recommends."""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Any

from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.control.recommended import Recommended, recommended_in
from stickslip.core.config import Table
from stickslip.core.errors import InputError
from stickslip.core.messages import name_option
from stickslip.models.model import Model
from stickslip.verbs.export_notes import axis_of, constant_torque

NUMBERS = ("gain", "lead", "deadband", "offset", "inertia_feedforward", "filter_hz")
"""Of a compensator: what "ff" or "fb" is given, and a recommendation sets."""


@dataclass(frozen=True)
class CompensatorOptions:
    """Numbers of a compensator; None leaves each at what the source says, or its default."""

    sample_time: float | None = None
    substeps: int | None = None
    gain: float | None = None
    lead: float | None = None
    deadband: float | None = None
    offset: float | None = None
    inertia_feedforward: float | None = None
    filter_hz: float | None = None

    @property
    def given(self) -> list[str]:
        """Names of those that are given."""
        return [f.name for f in fields(self) if getattr(self, f.name) is not None]


def compensator_of(content: Table, model: Model, options: CompensatorOptions, compensator: str) -> Controller:
    """A controller that has nothing but the compensator asked for, with what the file knows of its axis."""
    if compensator == "recommended":
        return recommended_on(content, model, options)
    kinds = {"ff": Feedforward, "fb": Feedback}
    axis = axis_of(content)
    known: dict[str, Any] = {
        "offset": axis.get("offset", 0.0), "inertia_feedforward": axis.get("inertia", 0.0)
    }  # fmt: skip
    known |= {n: getattr(options, n) for n in options.given if n != "sample_time"}
    time = 1e-3 if options.sample_time is None else options.sample_time
    return Controller(Gains(kp=0.0), kinds[compensator](model, **known), sample_time=time)


def recommended_on(content: Table, model: Model, options: CompensatorOptions) -> Controller:
    """What the file recommends, and nothing that it was not tried with.

    Raises
    ------
    InputError
    """
    found = recommendation_in(content)
    for option in options.given:
        if option in NUMBERS:
            raise InputError(
                f"{name_option(option)} and {name_option('compensator', 'recommended')}, which sets it; leave "
                "it out, or give "
                f"{name_option('compensator')} ff or fb"
            )
    tried, asked = found.sample_time, options.sample_time
    if tried and asked is not None and not math.isclose(tried, asked):
        raise InputError(
            f"{name_option('sample_time', f'{asked:g}')}: {content.document.name} is recommended for {tried:g} "
            "s; leave it out, or "
            "run `stickslip recommend` with that sample time"
        )
    made = replace(found.on(model), substeps=1 if options.substeps is None else options.substeps)
    return Controller(
        Gains(kp=0.0), made, sample_time=tried or asked or 1e-3, reference_velocity=found.reference_velocity
    )


def recommendation_in(content: Table) -> Recommended:
    """What a file recommends, with the constant torque that it holds of its axis."""
    found = recommended_in(content)
    return found if found.offset else replace(found, offset=constant_torque(content))
