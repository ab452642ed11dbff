"""The contract of a control law: what the composition, the engines and the exports rely on, held against one law.

What a law promises is in the docstring of `stickslip.core.control_spec`. Each law is tried in its place in a
controller: a friction law is put where it needs one, and a PD where it is no loop itself.
"""

from __future__ import annotations

import importlib
import math
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from stickslip.contract.angles import GIVES, in_other_angles, turns
from stickslip.contract.description import bounds, required, source_of
from stickslip.contract.rest import at_rest
from stickslip.contract.specimens import (
    COUNT,
    LIMIT,
    PD,
    TIME,
    Array,
    Plain,
    around,
    block_of,
    clean_motion,
    motion,
    replayed,
    specimen,
    torques,
    variants,
)
from stickslip.contract.units import parsed
from stickslip.contract.verdict import Verdict, failed, held, not_tried
from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.control.read_law import insist_on_subset
from stickslip.control.registry import control_law
from stickslip.core.control_spec import ControlLaw
from stickslip.core.errors import LawError
from stickslip.core.spec import Field, Surroundings
from stickslip.exports import c99_controller
from stickslip.models.model import Model
from stickslip.simulation.compiled_controller import compiled
from stickslip.subset import lower

__all__ = ["CHECKS", "Plain", "block_of", "examine", "specimen", "variants"]

INERTIA = 3.8623e-4
"""Of the axis on which a law is tried, kg·m²."""
BEGUN = 100
"""Samples after which a friction law has forgotten the jump to the first velocity."""
SAME = 1e-9
"""N·m: what torques in other units may differ by."""
JUMP = 1e-12
"""Of the limit: what the torque may jump by when a controller takes over."""
LEFT = 1e-6
"""Of the largest error: what a law that integrates may leave of it."""


# ---- the checks ----------------------------------------------------------------------------------------------------


def description(law: ControlLaw) -> Verdict:
    """Texts and units are there."""
    missing = [part for part in required(law) if not getattr(law, part)]
    missing += [
        f"{part} of {f.name}"
        for f in (*law.fields, *law.state_fields)
        for part in ("unit", "meaning")
        if not getattr(f.par, part)
    ]
    if law.place == "estimator" and law.delay is None:
        missing.append("delay")
    if missing:
        return failed("description", f"{', '.join(missing)} is missing")
    return held("description", f"{law.place}; {source_of(law)}")


def subset(law: ControlLaw) -> Verdict:
    """Every function is in the scalar subset and returns on every path."""
    controller = specimen(law)
    try:
        insist_on_subset(law)
        lower(controller.functions, controller.layouts)
    except LawError as error:
        return failed("subset", str(error))
    return held("subset", "all functions")


def same_bits(law: ControlLaw) -> Verdict:
    """Compiled, the law gives the bits of plain Python."""
    controller = specimen(law)
    mine, theirs = replayed(compiled(controller), motion()), torques(controller, motion())
    if not np.array_equal(mine, theirs):
        first = int(np.flatnonzero(mine != theirs)[0])
        return failed(
            "compiled", f"sample {first}: {theirs[first]!r} N·m in Python, {mine[first]!r} compiled"
        )
    return held("compiled", f"every bit of {COUNT} samples as plain Python")


def in_c(law: ControlLaw) -> Verdict:
    """Exported to C, in double precision, it gives the bits of plain Python."""
    export = c99_controller.write(specimen(law), "controller")
    result = c99_controller.check(export, "controller")
    return Verdict("C99", result.passed, result.text)


def in_single_precision(law: ControlLaw) -> Verdict:
    """Exported to C in single precision."""
    export = c99_controller.write(specimen(law), "controller", single=True)
    result = c99_controller.check(export, "controller")
    return Verdict("single precision", result.passed, result.text)


def limit_kept(law: ControlLaw) -> Verdict:
    """The torque stays within the limit, whatever is measured, and all of it is finite."""
    draw = np.random.default_rng(3)
    size = 10.0 ** draw.uniform(-9.0, 8.0, (20_000, 4))
    inputs = size * draw.choice((-1.0, 1.0), size.shape)
    torque = replayed(compiled(specimen(law)), inputs)
    worst = float(np.abs(torque).max())
    if not worst <= LIMIT:
        return failed("limit", f"a torque of {worst:g} N·m with a limit of {LIMIT:g} N·m")
    return held("limit", f"{len(inputs)} samples of any size: at most {worst:g} of {LIMIT:g} N·m")


def faults(law: ControlLaw) -> Verdict:
    """An input that is no number is a fault, leaves the state alone and does not come out as a torque."""
    good = motion()[: COUNT // 4]
    for place in range(6):
        for wrong in (math.nan, math.inf, -math.inf):
            plain = Plain(specimen(law))
            for row in good:
                plain(row)
            before, row = plain.state(), good[-1].copy()
            if place < 4:
                row[place] = wrong
            else:
                setattr(plain.u, ("load", "temperature")[place - 4], wrong)
            torque = plain(row)
            if not abs(torque) <= LIMIT or plain.m.fault != 1.0:
                return failed(
                    "fault", f"input {place} = {wrong}: torque {torque:g} N·m, fault {plain.m.fault:g}"
                )
            if plain.state() != before:
                return failed("fault", f"input {place} = {wrong} reaches the state")
            plain.u.load, plain.u.temperature = 1.0, 20.0
            if not abs(plain(good[-1])) <= LIMIT or plain.m.fault != 0.0:
                return failed("fault", f"after input {place} = {wrong} it does not go on")
    return held("fault", "inputs that are no numbers: declared, not given out, not remembered")


def taken_over(law: ControlLaw) -> Verdict:
    """After another controller's torque was watched, the first torque is that one."""
    plain, still, other = Plain(specimen(law)), (0.0, 0.02, 0.0, 0.0), 0.3
    alone = abs(Plain(specimen(law))(still) - other)
    for _ in range(200):
        plain(still, other)
    jump = abs(plain(still) - other)
    said = f"the torque jumps by {jump:.3g} N·m as it takes over, by {alone:.3g} without"
    return held("take-over", said) if jump <= JUMP * LIMIT else failed("take-over", said)


def units(law: ControlLaw) -> Verdict:
    """The same controller and motion in other units of torque, angle and time gives the same torque."""
    strange = [f.par.unit for f in block_of(law).fields if parsed(f.par.unit) is None]
    if strange:
        return not_tried("units", f"the unit {strange[0]!r} is not understood")
    inputs = clean_motion()  # how a fault fades is a setting of its own, s
    here, slow = (
        torques(specimen(law), inputs),
        specimen(law).settings.slow,
    )  # so is its slow velocity's corner
    for what, factors in (
        ("torque", (4.0, 1.0, 1.0)),
        ("angle", (1.0, 4.0, 1.0)),
        ("time", (1.0, 1.0, 0.25)),
    ):
        apart = float(np.abs(in_other_units(law, law, factors, inputs, slow) - here).max())
        if what == "angle" and not apart <= SAME:
            # A sine of the angle itself takes rad: in other units of angle it is another function.
            for gives in (GIVES, ()):
                turned = in_other_angles(law, factors[1], gives)
                sines = in_other_units(law, turned, factors, inputs, slow)
                apart = min(apart, float(np.abs(sines - here).max()))
        if not apart <= SAME:
            return failed(
                "units", f"in other units of {what} the torque is {apart:.2g} N·m off; correct a unit"
            )
    return held("units", "the same controller in other units gives the same torque")


def in_other_units(
    law: ControlLaw, same: ControlLaw, factors: tuple[float, float, float], inputs: Array, slow: float
) -> Array:
    """The torques in N·m of the controller in other units, whose functions are those of `same`."""
    torque, angle, time = factors
    block = scaled(block_of(law), same, factors)
    loop = scaled(ControlBlock("pd", **PD), control_law("pd"), factors)
    there = inputs * np.array([angle, angle, angle / time, angle / time**2])
    return torques(around(block, loop, LIMIT * torque, TIME * time), there, slow) / torque


def scaled(block: ControlBlock, law: ControlLaw, factors: tuple[float, float, float]) -> ControlBlock:
    """The block in other units, with the functions of a law that has its parameters."""
    p = block.parameters
    own = {f.name: in_units(f, getattr(p, f.name), factors) for f in law.fields}
    friction = block.friction
    if friction is not None:
        held_by = friction.parameters
        values = {f.name: in_units(f, getattr(held_by, f.name), factors) for f in friction.law.fields}
        friction = Model(friction.law, **values)
    return ControlBlock(law, friction, **own)


def in_units(f: Field, value: Any, factors: tuple[float, float, float]) -> Any:
    """A parameter's value in other units; an inertia is N·m over rad/s²."""
    unit = parsed(f.par.unit)
    assert unit is not None
    torque, angle, time = factors
    lengths = unit.radian - (1 if "kg·m²" in f.par.unit else 0)
    factor = torque**unit.newton * angle**lengths * time**unit.second
    return [factor * x for x in value] if f.per_element else factor * value


def superposition(law: ControlLaw) -> Verdict:
    """A law that is declared linear answers to the sum of two motions with the sum of its torques."""
    if not law.is_linear:
        return not_tried("linear", "the law is not declared linear")
    draw = np.random.default_rng(5)
    one, two = (np.cumsum(draw.standard_normal((COUNT, 4)), axis=0) * 1e-3 for _ in range(2))
    answers = [torques(specimen(law, math.inf), x) for x in (one, two, one + two)]
    apart = float(np.abs(answers[0] + answers[1] - answers[2]).max() / np.abs(answers[2]).max())
    said = f"the torque of a sum of two motions is {apart:.2g} of it off the sum of their torques"
    return held("linear", said) if apart <= 1e-9 else failed("linear", said)


def continuous(law: ControlLaw) -> Verdict:
    """The continuous form is what fine samples come to."""
    form = law.continuous(block_of(law).parameters) if law.continuous else "sampled only"
    if isinstance(form, str):
        return not_tried("continuous", form)
    if law.place == "estimator":
        return corner(law, form)
    time = 1e-5
    t = time * np.arange(20_000)
    reference, position = 0.02 * np.sin(20.0 * t), 0.015 * np.sin(20.0 * t - 0.2) + 0.015 * math.sin(0.2)
    velocities = 0.4 * np.cos(20.0 * t), 0.3 * np.cos(20.0 * t - 0.2)
    inputs = np.column_stack([position, reference, velocities[0], np.zeros(len(t))])
    expected = answer(law, form, reference - position, velocities, time)
    quiet = ControlBlock("pd", kp=0.0, kd=0.0)
    off = torques(around(block_of(law), quiet, math.inf, time), inputs)[BEGUN:] - expected[BEGUN:]
    # Where a contact reverses within a sample, its torque is off by that sample's displacement.
    size = np.abs(off).max() if isinstance(form, Gains) else np.sqrt(np.mean(off**2))
    apart = float(size / np.abs(expected).max())
    said = f"samples of {time:g} s are {apart:.2g} of the largest torque off it"
    return held("continuous", said) if apart <= 1e-3 else failed("continuous", said)


def integrating(law: ControlLaw) -> Verdict:
    """A law that is declared to integrate leaves no error where a torque pushes a moving axis: at rest it may not."""
    if not law.integrates:
        return not_tried("integrates", "the law is not declared to integrate")
    plain, push, speed = Plain(specimen(law)), 0.1, 0.1
    error = position = largest = 0.0
    velocity = speed
    for i in range(5000):
        error = speed * i * TIME - position
        torque = plain((position, speed * i * TIME, speed, 0.0)) - push
        position += TIME * (velocity + 0.5 * TIME * torque / INERTIA)
        velocity += TIME * torque / INERTIA
        largest = max(largest, abs(error))
    most = LEFT * largest
    said = f"{abs(error):.2g} rad are left of {largest:.2g} rad after 5 s; at most {most:.2g} rad ({LEFT:g} of it)"
    return held("integrates", said) if abs(error) <= most else failed("integrates", said)


def answer(law: ControlLaw, form: Any, error: Array, velocities: tuple[Array, Array], time: float) -> Array:
    """The torque of a continuous form, N·m, along velocities of the reference and as measured, rad/s."""
    if isinstance(form, Gains):
        torque = form.kp * error + form.kr * velocities[0] - form.kd * velocities[1]
        return torque + form.ki * time * (np.cumsum(error) - 0.5 * error)
    friction = block_of(law).friction
    assert friction is not None
    z, p, u = friction.law.state(friction.parameters), friction.parameters, Surroundings()
    v = velocities[0 if form.velocity == "reference" else 1]
    if form.corner > 0.0:
        signal: Any = importlib.import_module("scipy.signal")
        v = signal.lfilter(*signal.butter(2, form.corner, fs=2.0 * math.pi / time), v)
    steps = zip([v[0], *v[:-1]], v)
    return form.gain * np.array([friction.law.step(float(a), float(b), time, z, p, u) for a, b in steps])


def corner(law: ControlLaw, form: float) -> Verdict:
    """An estimator in continuous time lags by the time constant of its low-pass."""
    fine = 1e-9
    stated = law.delay(block_of(law).parameters, fine) if law.delay else math.nan
    said = f"a corner of {form:.6g} 1/s; samples of {fine:g} s lag by {stated:.6g} s"
    return (
        held("continuous", said)
        if abs(stated - 1.0 / form) <= 1e-3 / form + fine
        else failed("continuous", said)
    )


def delayed(law: ControlLaw) -> Verdict:
    """An estimator lags behind a constant acceleration by the delay that it states."""
    if law.place != "estimator" or law.delay is None:
        return not_tried("delay", "it is no estimator")
    t = np.linspace(0.0, 1999 * TIME, 2000)
    position = 0.5 * t * t
    reading = Controller(loop=ControlBlock("pd", kp=0.0, kd=1.0), sample_time=TIME, estimator=block_of(law))
    inputs: Array = np.column_stack([position, position, np.zeros((len(t), 2))])
    lag = float(t[-1] + torques(reading, inputs)[-1])
    stated = law.delay(block_of(law).parameters, TIME)
    said = f"it lags by {1e3 * lag:.6g} ms and states {1e3 * stated:.6g} ms"
    return held("delay", said) if abs(lag - stated) <= 1e-6 * TIME else failed("delay", said)


CHECKS: tuple[Callable[[ControlLaw], Verdict], ...] = (
    description, subset, bounds, units, same_bits, in_c, turns, in_single_precision, limit_kept, faults, taken_over,
    at_rest, superposition, continuous, integrating, delayed,
)  # fmt: skip
"""In the order in which `examine` runs them."""


def examine(law: ControlLaw) -> Iterator[Verdict]:
    """Hold a control law to its contract, check after check, under its chosen options.

    Yields
    ------
    Verdict
        As soon as it is known.
    """
    for check in CHECKS:
        try:
            yield check(law)
        except Exception as error:  # whatever the law's own code may raise
            yield failed(check.__name__.replace("_", " "), f"ends in {type(error).__name__}: {error}")
