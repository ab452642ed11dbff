"""Segments side by side: the corrections of the whole record, whatever the law; straight lines are the law's step."""

from __future__ import annotations

import ast
import inspect
import math
import os
import platform
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.core.spec import Surroundings
from stickslip.identification.observer.observer import GRASP, Motion, Prepared, prepare
from stickslip.jit import compiled_lanes, exponential
from stickslip.laws import LAWS
from stickslip.models.model import Model
from stickslip.models.plugins import law as law_named
from stickslip.simulation.recorded_input import segments as driven_lanes
from stickslip.simulation.recorded_input import simd_batch
from stickslip.simulation.recorded_input.branchless import Name, NotStraight, Trace, traced
from stickslip.simulation.recorded_input.simulation import Drive, Mechanics, drive_axis
from stickslip.subset import law_layouts, lower

Array = np.ndarray[Any, np.dtype[np.float64]]

PERIOD, COUNT = 1e-3, 1e-4
AXIS = Mechanics(inertia=1e-3, offset=0.01)
VALUES = {"fs": 0.4, "fc": 0.3, "vs": 0.1, "sigma2": 0.01, "sigma0": 800.0, "sigma1": 0.1, "k": 200.0}


def model_of(name: str) -> Model:
    """A law at the size of the motor below."""
    found = law_named(name)
    own = {f.name for f in found.fields}
    values = {k: v for k, v in VALUES.items() if k in own}
    if name == "gms":
        values |= {"k": [500.0, 300.0, 100.0], "alpha": [0.4, 0.35, 0.25], "c": 10.0}  # type: ignore[dict-item]
    return Model(found, **{**found.example, **values})


def motion(model: Model, strokes: int = 12, count: float = COUNT) -> Motion:
    """There and back at several speeds, driven by a torque with noise."""
    time = PERIOD * np.arange(strokes * 500)
    side = np.where((time // 0.5) % 2 == 0, 1.0, -1.0) * (0.45 + 0.15 * ((time // 1.0) % 3))
    torque = side + 0.01 * np.random.default_rng(1).standard_normal(time.size)
    out = drive_axis(AXIS, model, Drive(time, torque, "held", max_step=1e-4))
    return Motion(time, count * np.floor(out[:, 0] / count + 0.5) if count else out[:, 0], torque, count)


@pytest.mark.parametrize("grasp", [GRASP, math.inf], ids=["firm", "soft"])
@pytest.mark.parametrize("name", ["lugre", "gms", "coulomb"])
def test_stretches_find_what_the_whole_record_says(name: str, grasp: float):
    model = model_of(name)
    # Within a count nothing pulls: it takes longer until a begin is forgotten.
    for count, apart in ((0.0, 1e-5), (COUNT, 1e-2)):
        prepared = prepare(motion(model, count=count), model.law, AXIS.inertia, 0.3, 40.0, grasp=grasp)
        found = prepared.segments.corrections(AXIS, model.parameters)
        assert found is not None
        assert len(prepared.segments.cuts) >= 4
        off, whole = compared(prepared, found, model)
        assert off < apart * whole


def compared(prepared: Prepared, found: Array, model: Model) -> tuple[float, float]:
    """RMS of what segments find wrong, and of what the whole record says, in the band that counts."""
    whole = prepared.course.run(AXIS, model.parameters)[:, 3]
    inside = [prepared.low_pass(x) for x in (found - whole, whole)]
    return float(np.sqrt(np.mean(inside[0] ** 2))), float(np.sqrt(np.mean(inside[1] ** 2)))


def test_the_exponential_is_as_exact_as_it_says():
    x = np.concatenate([-np.geomspace(1e-9, 690.0, 2000), np.geomspace(1e-9, 690.0, 2000), [0.0]])
    found = np.array([exponential(v) for v in x])
    assert np.max(np.abs(found / np.exp(x) - 1.0)) < 1e-15


def test_a_kernels_own_array_is_used_until_its_end():
    # Compiled code frees an array after its last use, whatever a pointer into it reads or writes later.
    kernels = [f for f in ast.parse(inspect.getsource(simd_batch)).body if isinstance(f, ast.FunctionDef)]
    rooms = [f for f in kernels if any("aligned(" in ast.unparse(line) for line in f.body)]
    assert rooms
    for kernel in rooms:
        assert "room" in ast.unparse(kernel.body[-1]), kernel.name


def test_noise_shakes_both_alike():
    model = model_of("lugre")
    prepared = prepare(motion(model, count=0.0), model.law, AXIS.inertia, 0.3, 40.0)
    perturbed = prepared.perturbed(0.01 * np.sin(np.arange(prepared.course.drive.time.size)))
    found = perturbed.segments.corrections(AXIS, model.parameters)
    assert found is not None
    off, whole = compared(perturbed, found, model)
    assert off < 1e-5 * whole
    assert np.max(np.abs(found - prepared.raw(AXIS, model.parameters))) > 1e-3


def test_what_lanes_leave_to_the_whole_record():
    model = model_of("coulomb")
    prepared = prepare(motion(model), model.law, AXIS.inertia, 0.3, 40.0)
    pendulum = Mechanics(inertia=1e-3, gravity=0.05)
    assert prepared.segments.corrections(pendulum, model.parameters) is None
    np.testing.assert_array_equal(
        prepared.raw(pendulum, model.parameters), prepared.course.run(pendulum, model.parameters)[:, 3]
    )
    # Without a stroke long enough to forget there is nowhere to cut.
    time = PERIOD * np.arange(2000)
    short = Motion(time, 0.02 * np.sin(60.0 * time), 0.5 * np.sin(60.0 * time))
    assert prepare(short, model.law, 1e-3, 0.3, 40.0).segments.corrections(AXIS, model.parameters) is None


# ---- straight lines --------------------------------------------------------------------------------------------


def straight(name: str) -> tuple[Model, str]:
    """The text of a law's step from z0, z1, ... to z0_, z1_, ... and torque."""
    model = Model(name, **law_named(name).example)
    packed = [float(x) for x in model.law.pack(model.parameters)]
    trace = Trace(packed)
    count = len(model.law.pack_state(model.law.state(model.parameters)))
    arrays = {("p", i): Name(f"p[{i}]") for i in range(len(packed))} | {
        ("z", i): Name(f"z{i}") for i in range(count)
    }
    arrays |= {("u", i): x for i, x in enumerate(Surroundings())}
    result = traced(
        lower({"_step_": model.law.step}, law_layouts(model.law)), "_step_",
        {"v0": Name("v"), "v1": Name("v"), "dt": Name("h"), "z": "z", "p": "p", "u": "u"}, arrays, trace,
    )  # fmt: skip
    ends = [f"z{i}_ = {arrays['z', i]}" for i in range(count)]
    return model, "\n".join([*trace.lines, *ends, f"torque = {result}"])


def straight_laws() -> list[str]:
    """Laws that can be written so."""
    out: list[str] = []
    for name in LAWS:
        try:
            straight(name)
        except NotStraight:
            continue
        out.append(name)
    return out


STRAIGHT = straight_laws()


def test_most_laws_are_straight():
    assert {"coulomb", "stribeck", "lugre", "gms"} <= set(STRAIGHT)


@pytest.mark.parametrize("name", STRAIGHT)
@settings(max_examples=30)
@given(v=st.lists(st.floats(-2.0, 2.0), min_size=1, max_size=5), h=st.floats(1e-5, 1e-2))
def test_straight_lines_are_the_laws_step(name: str, v: list[float], h: float):
    model, text = straight(name)
    program = compile(text, name, "exec")
    state = model.law.state(model.parameters)
    known = {
        "p": np.asarray(model.law.pack(model.parameters), dtype=np.float64), "h": h, "math": math,
        "exponential": np.exp, "exponential_less_one": np.expm1, "select": lambda test, a, b: a if test else b,
    }  # fmt: skip
    for speed in v:
        before = np.asarray(model.law.pack_state(state), dtype=np.float64)
        scope = {**known, "v": np.float64(speed), **{f"z{i}": x for i, x in enumerate(before)}}
        with np.errstate(all="ignore"):
            exec(program, scope)
        expected = model.law.step(speed, speed, h, state, model.parameters, Surroundings())
        assert scope["torque"] == pytest.approx(expected, rel=1e-9, abs=1e-12)
        ends = [scope[f"z{i}_"] for i in range(len(model.law.pack_state(state)))]
        assert ends == pytest.approx(list(model.law.pack_state(state)), rel=1e-9, abs=1e-15)


def test_a_power_is_decided_by_the_shape_at_hand():
    law = law_named("lugre")
    gaussian = [float(x) for x in law.pack(Model(law, **law.example).parameters)]
    program = driven_lanes.program_for(law, gaussian)
    other = [float(x) for x in law.pack(Model(law, **law.example, delta_s=1.5).parameters)]
    assert program.follow is not None
    assert not program.fits(other)
    assert driven_lanes.program_for(law, other).follow is None
    assert driven_lanes.program_for(law, gaussian) is program


@pytest.mark.skipif(platform.machine() not in ("x86_64", "AMD64"), reason="reads x86 code")
def test_a_stage_is_solved_in_vectors():
    law = law_named("coulomb")
    packed = tuple(float(x) for x in law.pack(Model(law, **law.example).parameters))
    text = driven_lanes.source(law, Trace(packed))
    module = compiled_lanes(f"{text}\n# a text of its own, {os.getpid()}, since cached code has no listing")
    signals, out = np.ones((3, len(simd_batch.SIGNALS), 8)), np.zeros((3, 8))
    ones = simd_batch.Numbers(*[1.0] * len(simd_batch.Numbers._fields))
    module.follow_lanes(ones, packed, np.zeros(1), np.zeros(8), signals, 1, 8, out)
    (code,) = module.solve.inspect_asm().values()
    wide = [line for line in code.splitlines() if "vdivpd" in line and ("ymm" in line or "zmm" in line)]
    assert wide
