"""A controller made of control laws as tables of a TOML file; `stickslip.control.files` reads them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import fields
from typing import Any

from stickslip.control.block import ControlBlock
from stickslip.control.compensator import Compensator
from stickslip.control.controller import Controller
from stickslip.control.linear import Cascade
from stickslip.control.registry import control_law_names
from stickslip.core.control_spec import PLACES, ControlLaw
from stickslip.models.model import Model
from stickslip.models.tables import written

NameOf = Callable[[Model], str]
"""Gives a friction law the name under which a controller's table calls it."""


def tables_of(controller: Controller) -> dict[str, Any]:
    """The tables ``controller`` and ``laws`` (where friction laws are held), with every number.

    Parameters
    ----------
    controller : Controller
    """
    own: dict[str, Any] = {"sample_time": controller.sample_time, **_limits(controller)}
    held: dict[str, Any] = {}

    def name_of(part: str) -> NameOf:
        def named(model: Model) -> str:
            held[part] = _model(model)
            return part

        return named

    own |= _placed([(b, name_of(part)) for part, b in controller.blocks.items()])
    return {"controller": own, **({"laws": held} if held else {})}


def table_as_given(controller: Controller, name_of: NameOf) -> dict[str, Any]:
    """The table that makes this very controller again: its short form stays short.

    Parameters
    ----------
    controller : Controller
    name_of : callable
        The name in ``laws`` of a friction law that it holds.
    """
    own = _limits(controller)
    if controller.sample_time:
        own["sample_time"] = controller.sample_time
    blocks = (*controller.loop, *controller.feedforward, *controller.observer)
    if controller.estimator is not None:
        blocks = (controller.estimator, *blocks)
    if controller.gains is None and not blocks:  # A table has a compensator beside gains or laws alone.
        return own | _placed([(block, name_of) for block in controller.blocks.values()])
    if controller.gains is not None:
        own["cascade" if isinstance(controller.gains, Cascade) else "gains"] = controller.gains._asdict()
    if controller.velocity_filter:
        own["velocity_filter"] = controller.velocity_filter
    if controller.compensator:
        own |= compensator_table(controller.compensator, name_of)
    return own | _placed([(block, name_of) for block in blocks])


def compensator_table(compensator: Compensator, name_of: NameOf) -> dict[str, Any]:
    """The keys of a controller's table that say its compensator; what is as usual is left out."""
    numbers = [f for f in fields(compensator) if f.name != "model"]
    own = {f.name: getattr(compensator, f.name) for f in numbers}
    changed = {f.name: own[f.name] for f in numbers if own[f.name] != f.default}
    return {"compensator": compensator.name, "law": name_of(compensator.model), **changed}


def _limits(controller: Controller) -> dict[str, Any]:
    own = {"torque_limit": controller.torque_limit, "encoder_counts": controller.encoder_counts}
    limits: dict[str, Any] = {name: value for name, value in own.items() if value and math.isfinite(value)}
    if controller.reference_velocity:
        limits["reference_velocity"] = controller.reference_velocity
    return limits


def _placed(blocks: Sequence[tuple[ControlBlock, NameOf]]) -> dict[str, Any]:
    """The tables of blocks, at their places."""
    out: dict[str, Any] = {}
    for place in PLACES:
        tables = [block_table(b, name_of) for b, name_of in blocks if b.law.place == place]
        if tables:
            out[place] = tables[0] if len(tables) == 1 else tables
    return out


def block_table(block: ControlBlock, name_of: NameOf) -> dict[str, Any]:
    """The table of a block, which names its friction law."""
    known = control_law_names()
    table: dict[str, Any] = {"law": _named(block.law, known), **block.law.chosen}
    for f in block.law.fields:
        value = getattr(block.parameters, f.name)
        table[f.name] = list(value) if f.per_element else value
    if block.friction is not None:
        table["friction"] = name_of(block.friction)
    return table


def _model(model: Model) -> dict[str, Any]:
    """The table of a friction law; the slip rule belongs to a whole run."""
    return {name: value for name, value in written(model).items() if name != "slip_rule"}


def _named(law: ControlLaw, known: Any) -> str:
    """By what a file calls a law: its name, or the path of its file."""
    return law.name if law.name in known else str(law.written["sample"].__code__.co_filename)
