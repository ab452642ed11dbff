"""A controller made of control laws as tables of a TOML file; `stickslip.control.files` reads them."""

from __future__ import annotations

import math
from typing import Any

from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.registry import control_law_names
from stickslip.control_spec import PLACES, ControlLaw
from stickslip.model import Model
from stickslip.model_tables import written


def tables_of(controller: Controller) -> dict[str, Any]:
    """The tables ``controller`` and ``laws`` (where friction laws are held), with every number.

    Parameters
    ----------
    controller : Controller
    """
    own: dict[str, Any] = {"sample_time": controller.sample_time}
    if math.isfinite(controller.torque_limit):
        own["torque_limit"] = controller.torque_limit
    if controller.encoder_counts:
        own["encoder_counts"] = controller.encoder_counts
    held: dict[str, Any] = {}
    for place in PLACES:
        tables = [_block(p, b, held) for p, b in controller.blocks.items() if b.law.place == place]
        if tables:
            own[place] = tables[0] if len(tables) == 1 else tables
    return {"controller": own, **({"laws": held} if held else {})}


def _block(part: str, block: ControlBlock, held: dict[str, Any]) -> dict[str, Any]:
    """The table of a block; its friction law goes into ``held`` under the part's name."""
    known = control_law_names()
    table: dict[str, Any] = {"law": _named(block.law, known), **block.law.chosen}
    for f in block.law.fields:
        value = getattr(block.parameters, f.name)
        table[f.name] = list(value) if f.per_element else value
    if block.friction is not None:
        held[part] = _model(block.friction)
        table["friction"] = part
    return table


def _model(model: Model) -> dict[str, Any]:
    """The table of a friction law; the slip rule belongs to a whole run."""
    return {name: value for name, value in written(model).items() if name != "slip_rule"}


def _named(law: ControlLaw, known: Any) -> str:
    """By what a file calls a law: its name, or the path of its file."""
    return law.name if law.name in known else str(law.written["sample"].__code__.co_filename)
