"""Isaac Lab: the friction of an actuator group, as YAML with the names of `ActuatorBaseCfg`.

``friction`` is the static torque and ``dynamic_friction`` the Coulomb torque in N·m, ``viscous_friction`` is in
N·m·s/rad: read in the source of Isaac Lab 3.0 (isaaclab/actuators/actuator_base_cfg.py). PhysX has
this law since Isaac Sim 5.0 (PxJointFrictionParams). In earlier versions ``friction`` was a coefficient without unit.
"""

from __future__ import annotations

from typing import Any

from stickslip.exports._text import quoted, render
from stickslip.exports.job import Export, Job
from stickslip.exports.nearest import COULOMB, STATIC, carried
from stickslip.exports.target import Setting, Target, settings_of

NOTE = "the keys are those of Isaac Lab 3.0, read in its source; not tried in the simulator"


def write(job: Job) -> Export:
    """The YAML, and how to use it."""
    found = carried(job, TARGET.name, TARGET.forms)
    p: dict[str, float] = found.model.parameters._asdict()
    settings = settings_of(TARGET, job.settings)
    notes = (NOTE, *found.notes)
    values: dict[str, Any] = {
        "x": job.name, "law": job.model.law, "group": quoted(settings["group"]),
        "joints": quoted(settings["joints"]), "friction": repr(p.get("fs", p["fc"])), "dynamic": repr(p["fc"]),
        "viscous": repr(p["sigma2"]), "notes": notes,
    }  # fmt: skip
    files = {
        f"{job.name}.yaml": render("isaac.yaml.j2", **values),
        "README.md": render("isaac_readme.md.j2", **values),
    }
    return Export(files, notes)


TARGET = Target(
    "isaac",
    "Isaac Lab, friction of an actuator group (YAML)",
    write,
    forms=(COULOMB, STATIC),
    settings=(
        Setting("group", "axis", "name of the actuator group"),
        Setting("joints", ".*", "regular expression of the joints' names"),
    ),
    tried="a YAML parser; not in the simulator",
)
