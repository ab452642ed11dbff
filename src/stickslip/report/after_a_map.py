"""Next step after a map of the torque over the angle: its export, or identification of the axis if there is none."""

from __future__ import annotations

import shlex
from pathlib import Path

from stickslip.identification.estimate import Identification


def after_a_map(found: Identification, model_file: str | Path) -> tuple[str, str, str]:
    """Return the next step, with the line to copy in a shell and in Python."""
    waves = any(e.identified for e in found.estimates if e.name.partition("[")[0] in ("even", "odd"))
    if not waves and found.details["map"].form != "table":
        return (
            "No torque depends on the angle; identify the axis:", "stickslip identify log.csv --out axis",
            'ss.identify("log.csv")',
        )  # fmt: skip
    law, also = (" --position-map", ", position_map=True") if found.model is not None else ("", "")
    return (
        "Write the map for the drive (c99, moteus, odrive, vesc, st, beckhoff or linuxcnc):",
        f"stickslip export {shlex.quote(str(model_file))} --to c99{law} --out cogging",
        f'ss.export(found, to="c99"{also}, folder="cogging")',
    )
