"""MuJoCo: a joint of MJCF with the friction of a law.

Coulomb and viscous friction is the joint's ``frictionloss`` and ``damping``; LuGre friction, with a Stribeck shape
factor of 2, is the ``lugre`` attribute of a passive ``dcmotor`` actuator (MuJoCo 4.0 or later), with ``damping`` for
the viscous part. A difference between the directions is a constant torque: a ``general`` actuator. The inertia is the
joint's ``armature``. Attributes as in MuJoCo's XML reference.
"""

from __future__ import annotations

import functools
import importlib
import importlib.util
import math
from typing import Any
from xml.etree import ElementTree

from stickslip.core.errors import InputError
from stickslip.core.messages import axis_unit, name_setting
from stickslip.core.rebinding import NEGATIVE
from stickslip.core.spec import Surroundings
from stickslip.exports._mujoco_read import Part, joint_named, parts
from stickslip.exports._mujoco_run import drift, pulled, spring
from stickslip.exports._text import render
from stickslip.exports.job import Check, Export, Job
from stickslip.exports.nearest import (
    COULOMB,
    Curve,
    Form,
    Nearest,
    bristle_of,
    carried,
    fit_stribeck,
    parted,
    with_constant,
)
from stickslip.exports.target import Setting, Target, settings_of
from stickslip.models.model import Model

MOTOR = ("sigma0", "sigma1", "fc", "fs", "vs")
"""Of LuGre, in the order of the attribute ``lugre``."""
SHAPE = 2.0
"""Stribeck shape factor of MuJoCo's LuGre friction."""
STICK = 1e-6
"""Part of the torque at rest up to which the stiffness of a contact is measured."""


def fit_bristle(curve: Curve) -> dict[str, float]:
    """LuGre's parameters: the law's own stiffness, or a bend of 1e-4 rad where it is rigid; curve by least squares."""
    sliding = fit_stribeck(curve, shape=SHAPE)
    if contact := bristle_of(curve):
        return {**sliding, "sigma0": contact.stiffness, "sigma1": contact.damping}
    return {**sliding, "sigma0": stiffness(curve) or sliding["fs"] / 1e-4, "sigma1": 0.0}


def stiffness(curve: Curve) -> float:
    """Torque over a small displacement from rest, N·m/rad; 0 of a law without memory."""
    law, p = curve.model.law, curve.model.parameters
    if not law.state_fields:
        return 0.0
    way = 1e-3
    for _ in range(60):  # until the torque is that of a spring: a small part of what the contact withstands
        z = law.state(p)
        torque = law.step(way, way, 1.0, z, p, Surroundings()) - law.step(
            way, way, 0.0, law.state(p), p, Surroundings()
        )
        if 0.0 < torque <= STICK * curve.size:
            return torque / way
        way *= 0.25
    return 0.0


LUGRE = Form(
    "LuGre friction of Stribeck shape factor 2",
    "lugre",
    fit_bristle,
    frozenset({"bristle"}),
    fixed={"delta_s": SHAPE},
)


@functools.cache
def _asymmetric() -> tuple[Form, ...]:
    return tuple(map(with_constant, TARGET.forms))


def nearest_to(job: Job) -> Nearest:
    """Return MuJoCo's nearest model; a difference between the directions becomes a constant torque."""
    return carried(job, TARGET.name, TARGET.forms if job.model.law.odd else (*TARGET.forms, *_asymmetric()))


def write(job: Job) -> Export:
    """A model of one joint that runs as it is, and how to use it."""
    found = nearest_to(job)
    wanted = settings_of(TARGET, job.settings)
    step, inertia = float(wanted["timestep"]), float(wanted["inertia"])
    model, notes = for_timestep(found, step, inertia, str(wanted["contact"]))
    if constant := parted(model)[1]:
        notes = (
            *notes,
            f"half of the difference between the directions, {constant:.4g} {axis_unit('N·m')} against positive "
            "motion, is a constant "
            "torque: the `general` actuator gives it, whatever its input; copy it with the joint",
        )
    text = xml(job, model)
    table = pulled(text, job.model, inertia, step) if importlib.util.find_spec("mujoco") else []
    values: dict[str, Any] = {
        "x": job.name, "joint": wanted["joint"], "law": job.model.law, "notes": notes, "table": table,
        "lugre": model.law.name == "lugre", "spring": f"{spring(step):.3g}", "hold": holding_step(model),
    }  # fmt: skip
    return Export({f"{job.name}.xml": text, "README.md": render("mujoco_readme.md.j2", **values)}, notes)


def xml(job: Job, model: Model) -> str:
    """The model's file."""
    wanted = settings_of(TARGET, job.settings)
    model, constant = parted(model)
    p = model.parameters
    lugre = " ".join(repr(getattr(p, name)) for name in MOTOR) if model.law.name == "lugre" else ""
    return render(
        "mujoco.xml.j2", x=job.name, joint=wanted["joint"], timestep=repr(wanted["timestep"]),
        inertia=repr(wanted["inertia"]), damping=repr(p.sigma2), frictionloss=repr(p.fc), lugre=lugre,
        constant=repr(-constant) if constant else "", stiff=repr(2.0 * float(wanted["timestep"])),
        joint_type="slide" if job.linear else "hinge",
        mass=repr(1e-14 if job.linear else 1e-6),  # of a slide it adds to the armature
    )  # fmt: skip


def holding_step(model: Model) -> float:
    """The timestep up to which MuJoCo holds a stuck LuGre contact at rest, s; infinite for Coulomb friction.

    MuJoCo moves the bristle with the velocity before a step and takes the torque of its deflection before the step.
    Of a stuck contact, ``z' = v`` and ``J v' = -sigma0 z - (sigma1 + sigma2) v`` with the damping taken at the end of
    the step (``implicitfast``), the product of the eigenvalues of a step is below 1 for steps below
    (sigma1 + sigma2) / sigma0, whatever the inertia. Beyond, the contact rings, and drifts under a load.
    """
    if model.law.name != "lugre":
        return math.inf
    p = parted(model)[0].parameters
    return (p.sigma1 + p.sigma2) / p.sigma0


def for_timestep(found: Nearest, step: float, inertia: float, contact: str) -> tuple[Model, tuple[str, ...]]:
    """The model to write, and what a user must know of it.

    ``contact`` "identified" writes it as it is. "held" makes the contact no stiffer than the timestep holds at rest:
    the natural frequency of axis and bristle at most one over the step, and twice the damping of the bound.
    """
    if contact not in ("identified", "held"):
        raise InputError(f"{name_setting('contact', contact)}: give identified or held")
    model, bound = found.model, holding_step(found.model)
    if step < bound:
        return model, found.notes
    p = parted(model)[0].parameters
    soft = min(p.sigma0, inertia / step**2)
    damped = max(p.sigma1, 2.0 * step * soft - p.sigma2)
    if contact == "identified":
        warning = (
            f"at a timestep of {step:g} s MuJoCo does not hold this contact at rest: it oscillates, and drifts under a "
            f"load. It takes a timestep below {bound:.3g} s, or {name_setting('contact', 'held')}, which bends "
            f"{p.fs / soft:.3g} {axis_unit('rad')} before it breaks away instead of {p.fs / p.sigma0:.3g} "
            f"{axis_unit('rad')}"
        )
        return model, (*found.notes, warning)
    softer = Model(model.law, **{**model.parameters._asdict(), "sigma0": soft, "sigma1": damped})
    note = (
        f"contact softened to what a timestep of {step:g} s holds at rest: sigma0 {p.sigma0:.4g} to {soft:.4g} "
        f"{axis_unit('N·m/rad')}, sigma1 {p.sigma1:.4g} to {damped:.4g} {axis_unit('N·m·s/rad')}; the sliding "
        "curve is as it was"
    )
    return softer, (*found.notes, note)


# ---- reading ---------------------------------------------------------------------------------------------------


def read(text: str, joint: str | None = None) -> Model:
    """The friction of a joint of an MJCF file: LuGre where an actuator has it, else Coulomb and viscous.

    What the file's ``<default>`` classes give a joint counts as if it stood there.

    Parameters
    ----------
    text : str
    joint : str, optional
        Needed where the file has several.

    Raises
    ------
    InputError
        If it is no MJCF, has no such joint, or the choice is open.
    """
    try:
        root = ElementTree.fromstring(text)
    except ElementTree.ParseError as error:
        raise InputError(f"this is no MJCF: {error}") from None
    if root.tag == "robot":
        raise InputError("this is a URDF and no MJCF; read it with stickslip.exports.urdf.read")
    if root.tag not in ("mujoco", "mujocoinclude"):
        raise InputError(f"this is no MJCF: its root is <{root.tag}>, not <mujoco>")
    found = joint_named(root, joint)
    lugre = [
        m.attributes["lugre"]
        for m in parts(root, "dcmotor")
        if _drives(m, found) and m.attributes.get("lugre")
    ]
    constants = [m.attributes for m in parts(root, "general") if _drives(m, found) and _is_constant(m)]
    try:
        constant = -sum(float(a["biasprm"].split()[0]) for a in constants)
        damping = float(found.attributes.get("damping", "0").split()[0])
        if lugre:
            numbers = [float(x) for x in lugre[0].split()]
            values = dict(zip(MOTOR, numbers, strict=True))
            return with_difference(Model("lugre", sigma2=damping, delta_s=SHAPE, **values), constant)
        model = Model("coulomb", fc=float(found.attributes.get("frictionloss", "0")), sigma2=damping)
        return with_difference(model, constant)
    except (ValueError, IndexError) as error:
        raise InputError(f"joint {found.name!r}: its friction cannot be read ({error})") from None


def with_difference(model: Model, constant: float) -> Model:
    """The law with a constant torque as half the difference between its directions."""
    if constant == 0.0:
        return model
    law, values = model.law.having(symmetry="asymmetric"), model.parameters._asdict()
    twins = {f.name: values[f.name.removesuffix(NEGATIVE)] for f in law.fields if f.name.endswith(NEGATIVE)}
    levels = {"fc", "fs"} & values.keys()
    values |= (
        twins
        | {n: values[n] + constant for n in levels}
        | {n + NEGATIVE: values[n] - constant for n in levels}
    )
    return Model(law, **values)


def _is_constant(motor: Part) -> bool:
    """Whether an actuator gives a constant torque, whatever its input."""
    own = motor.attributes
    bias = [float(x) for x in own.get("biasprm", "0").split()]
    gain = [float(x) for x in own.get("gainprm", "1").split()]
    return own.get("biastype") == "affine" and not any(gain) and not any(bias[1:])


def _drives(motor: Part, joint: Part) -> bool:
    """Whether an actuator acts on that joint."""
    return bool(joint.name) and motor.attributes.get("joint") == joint.name


# ---- the check -------------------------------------------------------------------------------------------------


def check(job: Job, export: Export) -> Check:
    """Load it in MuJoCo, compare the numbers that it reads, and let it hold half of its torque for a second."""
    if importlib.util.find_spec("mujoco") is None:
        return Check(None, "MuJoCo is not installed (pip install 'stickslip[mujoco]')")
    engine: Any = importlib.import_module("mujoco")
    text = str(export.files[f"{job.name}.xml"])
    loaded = engine.MjModel.from_xml_string(text)
    wanted = settings_of(TARGET, job.settings)
    found = nearest_to(job)
    model, _ = for_timestep(
        found, float(wanted["timestep"]), float(wanted["inertia"]), str(wanted["contact"])
    )
    model, constant = parted(model)
    p = model.parameters
    pairs = [(loaded.dof_damping[0], p.sigma2), (loaded.dof_armature[0], float(wanted["inertia"]))]
    if model.law.name == "lugre":
        again = parted(read(text))[0].parameters
        pairs += [(getattr(again, name), getattr(p, name)) for name in MOTOR]
    else:
        pairs.append((loaded.dof_frictionloss[0], p.fc))
    pairs += [(loaded.actuator_biasprm[-1][0], -constant)] if constant else []
    error = max(abs(float(a) - b) for a, b in pairs)
    creep = drift(loaded, 0.5 * p.fc + constant)
    said = (
        f"MuJoCo reads it {error:.3g} off; half of the Coulomb torque moves it by {creep:.3g} "
        f"{axis_unit('rad')} in 1 s"
    )
    return Check(error == 0.0, said, {"mujoco": error, "drift": creep})


TARGET = Target(
    "mujoco",
    "MuJoCo, a joint with its friction (MJCF)",
    write,
    check,
    forms=(COULOMB, LUGRE),
    settings=(
        Setting("inertia", None, "inertia of the axis, kg·m²", lower=1e-15),
        Setting("timestep", 0.002, "timestep of the simulation, s", lower=1e-9, upper=0.1),
        Setting("joint", "joint", "name of the joint"),
        Setting("contact", "identified", "identified, or held: no stiffer than the timestep holds at rest"),
    ),
    tried="MuJoCo 4.0",
)
