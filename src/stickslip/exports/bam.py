"""BAM: parameter files of "Better Actuator Models" (M1 to M6), which its simulators load.

BAM lets friction withstand the stopping torque up to a budget: base (Coulomb) torque, a Stribeck part
exp(-(|v|/dtheta_stribeck)^alpha), parts in proportion to the torques that meet in the gearing, and viscous friction.
M1: base and viscous; M2: with Stribeck; M3, M4: with load; M5: with a load coefficient for the motor's torque and
one for the torque from outside; M6: with quadratic load terms, which no law here has. Keys and equations as in
version 1.0.2, https://github.com/Rhoban/bam (Duclusaud and Passault).
"""

from __future__ import annotations

import importlib
import importlib.util
import json
import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, cast

from stickslip.core.errors import InputError, ParameterError
from stickslip.core.messages import name_setting
from stickslip.exports._text import render
from stickslip.exports.job import CannotCarry, Check, Export, Job
from stickslip.exports.nearest import COULOMB, STRIBECK, Curve, Nearest, carried
from stickslip.exports.target import Setting, Target, settings_of
from stickslip.models.model import Model

KEYS = {
    "friction_base": "N·m, Coulomb torque",
    "friction_stribeck": "N·m, above it at rest",
    "dtheta_stribeck": "rad/s, Stribeck velocity",
    "alpha": "-, Stribeck shape factor",
    "load_friction_base": "-, per torque in the gearing",
    "load_friction_stribeck": "-, per torque in the gearing, above it at rest",
    "load_friction_motor": "-, per torque of the motor",
    "load_friction_external": "-, per torque from outside",
    "load_friction_motor_stribeck": "-, per torque of the motor, above it at rest",
    "load_friction_external_stribeck": "-, per torque from outside, above it at rest",
    "load_friction_motor_quad": "1/(N·m), quadratic",
    "load_friction_external_quad": "1/(N·m), quadratic",
    "friction_viscous": "N·m·s/rad",
}
LOADS: dict[str, tuple[str, ...]] = {
    "m1": (), "m2": (), "m3": ("load_friction_base",), "m4": ("load_friction_base", "load_friction_stribeck"),
    "m5": ("load_friction_motor", "load_friction_external", "load_friction_motor_stribeck",
           "load_friction_external_stribeck"),
}  # fmt: skip
LOADS["m6"] = (*LOADS["m5"], "load_friction_motor_quad", "load_friction_external_quad")
LARGEST = 10**300
"""What is not below it is no number of a motor: infinite, not a number, or a whole number that is no real one."""
UNLOADED = "the growth of its viscous part with the load"


@dataclass(frozen=True)
class Bam:
    """What a parameter file says of friction.

    Attributes
    ----------
    variant, actuator : str
        "m1" to "m6"; BAM's name of the motor.
    model : Model
        Friction without load.
    loads : mapping
        The load terms by BAM's names, which add to the budget.
    """

    variant: str
    actuator: str
    model: Model
    loads: Mapping[str, float]


def write(job: Job) -> Export:
    """One parameter file and how to use it."""
    content, found = written(job)
    name = content["model"]
    rows = [(key, repr(content[key]), KEYS[key]) for key in content if key in KEYS]
    values: dict[str, Any] = {
        "x": job.name, "law": job.model.law, "variant": name, "actuator": content["actuator"], "rows": rows,
        "notes": found.notes,
    }  # fmt: skip
    files = {
        f"{job.name}.json": json.dumps(content, indent=2) + "\n",
        "README.md": render("bam_readme.md.j2", **values),
    }
    return Export(files, found.notes)


def written(job: Job) -> tuple[dict[str, Any], Nearest]:
    """The content of the file, and the model that it holds."""
    settings = settings_of(TARGET, job.settings)
    motor, external = float(settings["load_motor"]), float(settings["load_external"])
    wanted = str(settings["variant"])
    if wanted not in ("any", *LOADS):
        raise InputError(f"{name_setting('variant', wanted)}: choose any or one of {', '.join(LOADS)}")
    forms, loaded = [COULOMB, STRIBECK], motor > 0.0 or external > 0.0
    if wanted in ("m1", "m3"):
        forms = [COULOMB]
    if loaded and _exponent(job.model) == 1.0:
        forms = [replace(form, keeps=form.keeps | {"load"}) for form in forms]
    sigma2 = Curve.of(job.model).model.parameters._asdict().get("sigma2", 0.0)
    found = carried(job, TARGET.name, forms, [UNLOADED] if loaded and sigma2 != 0.0 else [])
    variant = _variant(found.form.law == STRIBECK.law, motor, external)
    if wanted != "any":
        variant = _checked(wanted, variant)
    return _content(found.model, variant, motor, external) | {
        "model": variant, "actuator": settings["actuator"]
    }, found  # fmt: skip


def _exponent(model: Model) -> float | None:
    """The power of the relative load where the law reads it itself; 1 where friction is scaled from outside."""
    values: dict[str, float] = model.parameters._asdict()
    return values.get("load_exponent", 1.0)


def _variant(stribeck: bool, motor: float, external: float) -> str:
    """The simplest variant with these parts."""
    if motor != external:
        return "m5"
    if motor > 0.0:
        return "m4" if stribeck else "m3"
    return "m2" if stribeck else "m1"


def _checked(wanted: str, least: str) -> str:
    """The variant asked for, where it has all the parts of the simplest one."""
    holds = {"m1": ("m1", "m2", "m3", "m4", "m5", "m6"), "m2": ("m2", "m4", "m5", "m6"), "m3": ("m3", "m4", "m5", "m6"),
             "m4": ("m4", "m5", "m6"), "m5": ("m5", "m6")}  # fmt: skip
    if wanted in holds[least]:
        return wanted
    raise CannotCarry(
        f"bam's {wanted} would lose friction that grows with the load; leave {name_setting('variant', wanted)} "
        f"out for {least}, "
        "or set load_motor and load_external to 0"
    )


def _content(model: Model, variant: str, motor: float, external: float) -> dict[str, Any]:
    values: dict[str, float] = model.parameters._asdict()
    base = values["fc"]
    rise = values.get("fs", base) - base
    out = {"friction_base": base}
    if variant not in ("m1", "m3"):
        out |= {
            "friction_stribeck": rise,
            "dtheta_stribeck": values.get("vs", 0.1),
            "alpha": values.get("delta_s", 2.0),
        }
    loads = {
        "load_friction_base": base * motor, "load_friction_stribeck": rise * motor,
        "load_friction_motor": base * motor, "load_friction_external": base * external,
        "load_friction_motor_stribeck": rise * motor, "load_friction_external_stribeck": rise * external,
        "load_friction_motor_quad": 0.0, "load_friction_external_quad": 0.0,
    }  # fmt: skip
    return out | {key: loads[key] for key in LOADS[variant]} | {"friction_viscous": values["sigma2"]}


# ---- the way back -----------------------------------------------------------------------------------------------


def read(text: str) -> Bam:
    """The friction of a BAM parameter file.

    Raises
    ------
    InputError
        If it is no such file, or a number of its variant is missing.
    """
    try:
        content: Any = json.loads(text)
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"this is no BAM file: {error}") from None
    table = cast("dict[str, Any]", content) if isinstance(content, dict) else {}
    variant = table.get("model")
    if not isinstance(variant, str) or variant not in LOADS:
        raise InputError('this is no BAM file: it has no "model" that is one of m1 to m6')
    bent = variant not in ("m1", "m3")
    fc, sigma2 = _number(table, "friction_base"), _number(table, "friction_viscous")
    loads = {key: _number(table, key) for key in LOADS[variant]}
    values: dict[str, Any] = {"fc": fc, "sigma2": sigma2}
    if bent:
        values |= {
            "fs": fc + _number(table, "friction_stribeck"),
            "vs": _number(table, "dtheta_stribeck"),
            "delta_s": _number(table, "alpha"),
        }
    try:
        model = Model("stribeck_plain" if bent else "coulomb", **values)
    except ParameterError as error:
        raise InputError(f"a BAM file of a friction that no law here has: {error}") from None
    return Bam(variant, str(table.get("actuator", "")), model, loads)


def _number(table: Mapping[str, Any], key: str) -> float:
    value = table.get(key)
    if isinstance(value, bool) or not isinstance(value, (int, float)) or not abs(value) < LARGEST:
        raise InputError(f"a BAM file of model {table['model']} needs the number {key!r}, not {value!r}")
    return float(value)


# ---- the check --------------------------------------------------------------------------------------------------


def budget(content: Mapping[str, Any], velocity: float, motor: float, external: float) -> float:
    """The torque up to which BAM lets friction act, without its viscous part, N·m (its equations for M1 to M6)."""

    def term(key: str) -> float:
        return float(content.get(key, 0.0))

    bend = 0.0
    if "alpha" in content:
        bend = math.exp(-(abs(velocity / term("dtheta_stribeck")) ** term("alpha")))
    gearing = abs(external - motor)
    load = abs(external * term("load_friction_external") - motor * term("load_friction_motor"))
    load_at_rest = abs(
        external * term("load_friction_external_stribeck") - motor * term("load_friction_motor_stribeck")
    )
    at_rest = term("friction_stribeck") + term("load_friction_stribeck") * gearing + load_at_rest
    return term("friction_base") + term("load_friction_base") * gearing + load + bend * at_rest


def check(job: Job, export: Export) -> Check:
    """Compare the budget with the law, by BAM's equations and by BAM itself where it is installed."""
    content: dict[str, Any] = json.loads(str(export.files[f"{job.name}.json"]))
    settings = settings_of(TARGET, job.settings)
    drive, outer = float(settings["load_motor"]), float(settings["load_external"])
    ours = Curve.of(written(job)[1].model, written(job)[1].top)
    viscous: float = ours.model.parameters.sigma2
    theirs = _installed(content)
    errors: dict[str, float] = {"equations": 0.0} | ({"bam": 0.0} if theirs else {})
    for v in (float(x) for x in ours.velocity):
        for motor, external in ((0.0, 0.0), (1.0, -0.5), (-0.4, 2.0)):
            expected = (1.0 + abs(drive * motor - outer * external)) * (
                ours.torque(v) - viscous * v
            ) + viscous * v
            own = budget(content, v, motor, external) + float(content["friction_viscous"]) * v
            errors["equations"] = max(errors["equations"], abs(own - expected))
            if theirs:
                loss, damping = theirs.compute_frictions(motor, external, v)
                errors["bam"] = max(errors["bam"], abs(float(loss) + damping * v - expected))
    worst = max(errors.values())
    by = "BAM" if theirs else "by BAM's equations (BAM itself is not installed)"
    return Check(worst <= 1e-9 * ours.size, f"{by}: at most {worst:.3g} N·m off", errors)


def _installed(content: Mapping[str, Any]) -> Any:
    """The model as BAM loads it, where BAM is installed."""
    if importlib.util.find_spec("bam") is None or importlib.util.find_spec("bam.model") is None:
        return None
    return importlib.import_module("bam.model").load_model_from_dict(dict(content))


TARGET = Target(
    "bam",
    "BAM parameter file (Better Actuator Models, M1 to M6)",
    write,
    check,
    forms=(
        COULOMB,
        replace(STRIBECK, words="Stribeck and viscous friction, also growing with the torque in the gearing"),
    ),
    settings=(
        Setting("actuator", "mx106", "BAM's name of the motor"),
        Setting("variant", "any", "m1 to m6, or any: the simplest that holds the law"),
        Setting("load_motor", 0.0, "growth of friction per torque of the motor, 1/(N·m)", 0.0, 1e6),
        Setting("load_external", 0.0, "growth of friction per torque from outside, 1/(N·m)", 0.0, 1e6),
    ),
    tried="BAM 1.0.2",
)
