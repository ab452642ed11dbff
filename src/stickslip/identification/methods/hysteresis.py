"""A law along the measured motion, from a measured friction: Dahl, per direction, or Maxwell-slip."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from stickslip.core.errors import UnknownName
from stickslip.core.messages import name_option
from stickslip.core.record import Record
from stickslip.identification.estimate import Identification
from stickslip.identification.methods._records import has_torque, single, with_torque
from stickslip.identification.methods.method import TORQUE, Method, Options
from stickslip.identification.presliding.hysteresis import Loop, choose_hysteresis, templates_for

ROWS = 8000
"""Most rows to which a loop is fitted: more take longer and hardly change the values."""


def identify(records: Sequence[Record], options: Options) -> Identification:
    """Identify the law that best predicts blocks left out."""
    (record,), channel = with_torque([single(records, "hysteresis")], options, "hysteresis")
    whole = Loop.of(record, channel)
    every = max(1, whole.time.size // ROWS)
    loop = Loop(whole.time[::every], whole.position[::every], whole.torque[::every], whole.unit)
    templates = templates_for(loop, np.arange(loop.time.size))
    names = sorted({model.law.name for model in templates.values()})
    asked = [law if isinstance(law, str) else law.name for law in options.laws]
    for law in asked:
        if law not in names:
            raise UnknownName(f"law of {name_option('method', 'hysteresis')}", law, names)
    wanted = {k: m for k, m in templates.items() if not asked or m.law.name in asked}
    chosen, found, table = choose_hysteresis(loop, wanted)
    said = [
        f"Chosen: {chosen}. Error on blocks left out: "
        + "; ".join(f"{name} {100.0 * row['cross_validated']:.2g} %" for name, row in table.items())
        + "."
    ]
    if every > 1:
        said.append(f"One row of {every} was fitted, {loop.time.size} in all.")
    details = {**found.details, "chosen": chosen}
    return replace(found, notes=(*said, *found.notes), details=details)


METHOD = Method(
    "hysteresis",
    "a law along the motion, from measured friction",
    identify,
    has_torque("hysteresis"),
    uses=TORQUE | {"laws"},
    values=(),
)
