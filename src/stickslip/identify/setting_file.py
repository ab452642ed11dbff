"""recommended.toml of what `stickslip.identify.recommend` found: the law to run with ``[recommended]``."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from stickslip.config import read_toml
from stickslip.control.recommended import Recommended
from stickslip.errors import InputError
from stickslip.identify.estimate import Identification
from stickslip.identify.identified_file import Identified
from stickslip.identify.model_file import write_model
from stickslip.identify.recommend import Recommendation
from stickslip.machines.servo import ServoAxis

__all__ = ["write_setting"]


def write_setting(path: str | os.PathLike[str], found: Identified, advice: Recommendation) -> Path:
    """Write what is recommended: the same form as that of `stickslip rig commission`, without a machine's name.

    Parameters
    ----------
    path : path
    found : Identified
        What the advice was made for.
    advice : Recommendation

    Raises
    ------
    InputError
        If nothing is recommended, or it cannot be written.
    """
    target = Path(path)
    if advice.chosen is None or advice.model is None:
        raise InputError(f"no compensator is recommended, so that there is nothing to write to {target}")
    setting, drive = advice.chosen.setting, advice.drive
    own = drive.gains is not None or drive.linear != "PD"
    table = Recommended(
        setting.kind, setting.gain, drive.bandwidth, drive.damping, advice.inertia, setting.lead, setting.deadband,
        sample_time=drive.sample_time, offset=setting.offset, inertia_feedforward=setting.inertia_feedforward,
        gains=drive.loop(advice.inertia).gains if own else None, velocity_filter=drive.velocity_filter,
    ).table()  # fmt: skip
    motion = ServoAxis(motion="linear") if found.motion == "linear" else ServoAxis()
    result = Identification(
        "recommendation", advice.model, (), np.eye(0), {}, advice.notes,
        details={"axis": motion},
    )  # fmt: skip
    written = str(read_toml(found.path).values["law"])
    kept = written.endswith(".py") and advice.model.law.name == found.model.law.name
    return write_model(
        target, result, data=found.data, law=str(found.path.parent / written) if kept else "",
        more={"axis": {**found.axis, "inertia": advice.inertia}, "recommended": table},
    )  # fmt: skip
