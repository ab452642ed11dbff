"""Write recommended.toml from the result of `stickslip.recommendation.recommend`: the law, with ``[recommended]``."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from stickslip.control.recommended import Recommended
from stickslip.control.written import tables_of
from stickslip.core.config import Table
from stickslip.core.errors import InputError
from stickslip.identification.estimate import Identification
from stickslip.identification.identified_file import Identified
from stickslip.identification.model_file import in_memory, model_content, write_model
from stickslip.machines.servo import ServoAxis
from stickslip.recommendation.recommend import Recommendation


def write_setting(path: str | os.PathLike[str], found: Identified, advice: Recommendation) -> Path:
    """Write the recommendation, in the form of `stickslip rig commission` without the name of a machine.

    With a loop of control laws, or a compensator of the catalogue: the whole controller, as `stickslip.control.files`
    reads it.

    Parameters
    ----------
    path : path
    found : Identified
        The model of the recommendation.
    advice : Recommendation

    Raises
    ------
    InputError
        If nothing is recommended, or it cannot be written.
    """
    target = Path(path)
    if advice.chosen is None and advice.instead is None:
        raise InputError(f"no compensator is recommended, so there is nothing to write to {target}")
    result, law, more = _parts(found, advice)
    return write_model(target, result, data=found.data, law=law, more=more)


def setting_table(found: Identified, advice: Recommendation) -> Table:
    """Return the table that `write_setting` writes.

    Raises
    ------
    InputError
        If nothing is recommended.
    """
    if advice.chosen is None and advice.instead is None:
        raise InputError("no compensator is recommended, so there is nothing to export")
    result, law, more = _parts(found, advice)
    return in_memory(model_content(result, found.data, os.path.realpath(law) if law else "", more))


def _parts(found: Identified, advice: Recommendation) -> tuple[Identification, str, dict[str, Any]]:
    """Return the law, the path of its file, and the further tables."""
    further = _further(advice)
    model = advice.model or found.model
    motion = ServoAxis(motion="linear") if found.motion == "linear" else ServoAxis()
    result = Identification(
        "recommendation", model, (), np.eye(0), {}, advice.notes,
        details={"axis": motion},
    )  # fmt: skip
    kept = found.law_file if model.law.name == found.model.law.name else ""
    more = {"axis": {**found.axis, "inertia": advice.inertia}, **further}
    return result, kept, more


def _further(advice: Recommendation) -> dict[str, Any]:
    """Return the controller if it is made of control laws, else the setting with the linear one."""
    if advice.instead is not None:
        assert advice.instead.controller is not None
        return tables_of(advice.instead.controller)
    assert advice.chosen is not None
    assert advice.model is not None
    loop = advice.drive.loop(advice.inertia)
    if not loop.is_short:
        return tables_of(advice.chosen.setting.on(loop, advice.model))
    return {"recommended": recommended_table(advice)}


def recommended_table(advice: Recommendation, machine: str = "") -> dict[str, Any]:
    """Return ``[recommended]``: the setting with a linear controller, and the machine on which it was measured."""
    assert advice.chosen is not None
    drive, setting = advice.drive, advice.chosen.setting
    loop = drive.loop(advice.inertia)
    own = drive.given or drive.linear != "PD"
    return Recommended(
        setting.kind, setting.gain, drive.bandwidth, drive.damping, advice.inertia, setting.lead, setting.deadband,
        sample_time=drive.sample_time, machine=machine, offset=setting.offset,
        inertia_feedforward=setting.inertia_feedforward,
        gains=loop.gains if own else None, velocity_filter=loop.velocity_filter,
        torque_limit=loop.torque_limit, encoder_counts=loop.encoder_counts,
        reference_velocity=loop.reference_velocity,
    ).table()  # fmt: skip
