"""URDF: the `<dynamics>` of a joint, Coulomb and viscous friction.

``friction`` is in N·m, ``damping`` in N·m·s/rad (N and N·s/m of a prismatic joint): the joint element of the URDF
specification, http://wiki.ros.org/urdf/XML/joint. What a simulator makes of ``friction`` is up to it; MuJoCo and
Gazebo take it for Coulomb friction.
"""

from __future__ import annotations

import importlib
import importlib.util
from typing import Any
from xml.etree import ElementTree

from stickslip.core.errors import InputError
from stickslip.exports._text import render
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.nearest import COULOMB, carried
from stickslip.exports.target import Setting, Target, settings_of
from stickslip.models.model import Model

NAMES = {"fc": "friction", "sigma2": "damping"}


def write(job: Job) -> Export:
    """A robot of one joint that can be loaded as it is, and how to use it."""
    found = carried(job, TARGET.name, TARGET.forms)
    p = found.model.parameters
    joint = settings_of(TARGET, job.settings)["joint"]
    values: dict[str, Any] = {
        "x": job.name, "joint": joint, "friction": repr(p.fc), "damping": repr(p.sigma2), "law": job.model.law,
        "notes": found.notes, "joint_type": "prismatic" if job.linear else "continuous",
    }  # fmt: skip
    files = {
        f"{job.name}.urdf": render("urdf.urdf.j2", **values),
        "README.md": render("urdf_readme.md.j2", **values),
    }
    return Export(files, found.notes)


def read(text: str, joint: str | None = None) -> Model:
    """The friction of a joint of a URDF, as Coulomb and viscous friction.

    Parameters
    ----------
    text : str
    joint : str, optional
        Needed where several joints have dynamics.

    Raises
    ------
    InputError
        If it is no URDF, or has no such joint, or the choice is open.
    """
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InputError(f"this is no URDF: {error}") from None
    pairs = [(j.get("name", ""), d) for j in root.iter("joint") if (d := j.find("dynamics")) is not None]
    found = dict(pairs)
    if len(found) < len(pairs):
        twice = next(name for name, _ in pairs if sum(name == other for other, _ in pairs) > 1)
        raise InputError(f"several joints are called {twice!r}; give each a name of its own")
    if joint is None and len(found) == 1:
        (joint,) = found
    if joint is None or joint not in found:
        raise InputError(
            f"joint {joint!r} has no <dynamics>; name one of {', '.join(found) or 'none: the file has no such joint'}"
        )
    written = {ours: found[joint].get(theirs, "0") for ours, theirs in NAMES.items()}
    try:
        values: dict[str, Any] = {name: float(value) for name, value in written.items()}
    except ValueError:
        raise InputError(f"joint {joint!r}: {written} are no numbers") from None
    return Model("coulomb", **values)


def check(job: Job, export: Export) -> Check:
    """Load it in MuJoCo, and compare the friction that it reads."""
    if importlib.util.find_spec("mujoco") is None:
        return Check(None, "MuJoCo is not installed (pip install 'stickslip[benchmarks]')")
    mujoco: Any = importlib.import_module("mujoco")
    text = str(export.files[f"{job.name}.urdf"])
    loaded = mujoco.MjModel.from_xml_string(text)
    p = carried(job, TARGET.name, TARGET.forms).model.parameters
    error = max(abs(float(loaded.dof_frictionloss[0]) - p.fc), abs(float(loaded.dof_damping[0]) - p.sigma2))
    return Check(error == 0.0, f"MuJoCo reads friction and damping {error:.3g} off", {"mujoco": error})


TARGET = Target(
    "urdf",
    "URDF, the dynamics of a joint",
    write,
    check,
    forms=(COULOMB,),
    settings=(Setting("joint", "joint", "name of the joint"),),
    tried="MuJoCo",
)
