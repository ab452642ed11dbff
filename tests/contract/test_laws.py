"""One suite over every registered law, and over a law added in one file.

A law that passes simulates, compensates and compiles; the engines may rely on nothing else.
"""

from __future__ import annotations

import ctypes
import math
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

import stickslip
from stickslip.contract.agreement import step_against_rate, step_errors
from stickslip.contract.description import bounds
from stickslip.contract.motions import example, level_of
from stickslip.control.compensator import Feedback, Feedforward
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Law, Mode, Surroundings
from stickslip.jit import compiled_step, flat
from stickslip.laws import LAWS as BUILT_IN
from stickslip.machines.rigid import RigidAxis
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate

LAWS = [plugins.law(name) for name in plugins.law_names()]
U = Surroundings()


def laws_that(condition):
    """Try a test with every law that meets a condition."""
    return pytest.mark.parametrize("law", [law for law in LAWS if condition(law)], ids=lambda law: law.name)


every_law = laws_that(lambda law: True)

speeds = st.builds(
    lambda m, e, s: s * m * 10.0**e, st.floats(1, 10), st.integers(-7, 0), st.sampled_from((-1.0, 1.0))
)
# Of one number each, since hypothesis spends its time drawing: half of all are at rest, the others over eight decades.
velocities = st.floats(-16, 16).map(
    lambda x: 0.0 if abs(x) < 8.0 else math.copysign(10.0 ** (abs(x) - 15.0), x)
)
steps = st.floats(-7, 0).map(lambda e: 10.0**e)
motions = st.lists(st.tuples(velocities, steps), min_size=1, max_size=30)


def is_passive(law: Law) -> bool:
    """Whether the law declares itself passive with its example parameters."""
    return law.passive not in ("", "never") and (law.is_passive is None or law.is_passive(example(law)))


def steady_of(law: Law, v: float) -> float:
    """Torque at constant velocity, N·m; where it depends on the past, after a short time at it."""
    p = example(law)
    return law.steady(v, p) if law.steady else law.step(v, v, 1.0, law.state(p), p, U)


def drive(law, p, motion, z=None):
    """Torques along a motion of (end velocity, time step) from rest."""
    z = law.state(p) if z is None else z
    v, out = 0.0, []
    for end, dt in motion:
        out.append(law.step(v, end, dt, z, p, U))
        v = end
    return out, z


class Compiled:
    """The compiled step, called as the kernels call it."""

    def __init__(self, law: Law, p) -> None:
        pointer = ctypes.POINTER(ctypes.c_double)
        kind = ctypes.CFUNCTYPE(ctypes.c_double, *[ctypes.c_double] * 3, pointer, pointer, pointer)
        self.function = kind(compiled_step(law))
        self.p, self.u = flat(law.pack(p)), flat(list(U))
        self.z = flat(law.pack_state(law.state(p)))

    def __call__(self, v0, v1, dt):
        address = [a.ctypes.data_as(ctypes.POINTER(ctypes.c_double)) for a in (self.z, self.p, self.u)]
        return self.function(v0, v1, dt, *address)


@every_law
def test_description_is_complete(law):
    assert law.title
    assert law.equation
    assert law.source
    names = [f.name for f in law.fields]
    assert len(names) == len(set(names))
    for f in (*law.fields, *law.state_fields):
        assert f.par.unit, f.name
        assert f.par.symbol, f.name
        assert f.par.meaning, f.name
    assert law.step.__doc__
    assert (law.guards is None) == (law.switch is None)
    assert (law.rate is not None and any(isinstance(f.par, Mode) for f in law.state_fields)) == (
        law.guards is not None
    )


@laws_that(lambda law: law.name in BUILT_IN)
def test_sources_are_in_the_bibliography(law):
    """Every source of a built-in law is a place in the thesis or a key of references.bib."""
    bibliography = (Path(stickslip.__file__).parent / "references.bib").read_text()
    for source in law.source:
        assert source.startswith("thesis") or f"{{{source}," in bibliography, source


@every_law
def test_parameters_out_of_bounds_are_refused(law):
    assert bounds(law).passed, bounds(law)
    good = dict(law.example)
    for f in law.fields:
        if f.par.default is None:
            with pytest.raises(ParameterError, match=f.name):
                law.parameters({k: v for k, v in good.items() if k != f.name})
    with pytest.raises(ParameterError, match="no parameter 'nonsense'"):
        law.parameters({**good, "nonsense": 1.0})


@every_law
def test_compiled_equals_plain_python_bit_for_bit(law):
    p = example(law)
    compiled, z = Compiled(law, p), law.state(p)
    rng = np.random.default_rng(7)
    v = 0.0
    for _ in range(5000):
        end = rng.choice([0.0, 1.0, 1.0, 1.0, 1.0]) * rng.normal() * 10.0 ** rng.uniform(-8, 0)
        dt = 10.0 ** rng.uniform(-7, 0)
        assert law.step(v, end, dt, z, p, U) == compiled(v, end, dt)
        v = end
    assert law.pack_state(z) == list(compiled.z[: law.state_size(p)])


@every_law
@given(motion=motions)
@settings(max_examples=150)
def test_step_is_bounded_for_any_time_step(law, motion):
    p = example(law)
    torques, z = drive(law, p, motion)
    # A contact never gives more than its largest level, besides what is proportional to the velocity.
    levels = [getattr(p, name) for name in ("fs", "fc") if hasattr(p, name)]
    level = max(levels) if hasattr(p, "fc") else level_of(law, p) if law.name != "viscous" else 0.0
    level += getattr(p, "fs_inf", 0.0)
    slope = sum(getattr(p, name, 0.0) for name in ("sigma1", "sigma2"))
    for torque, (v, _) in zip(torques, motion):
        assert math.isfinite(torque)
        assert abs(torque) <= 1.0001 * level + 2.0 * slope * max(abs(v), max(abs(w) for w, _ in motion))
    assert all(math.isfinite(x) for x in law.pack_state(z))


@every_law
@given(motion=motions, v=velocities)
@settings(max_examples=60)
def test_a_step_of_no_length_is_the_torque_now(law, motion, v):
    """Engines take the first torque of a run so; nothing is divided by dt."""
    p = example(law)
    torques, z = drive(law, p, motion)
    last = motion[-1][0]
    before = law.pack_state(z)
    assert law.step(last, last, 0.0, z, p, U) == pytest.approx(torques[-1], rel=1e-12, abs=1e-15)
    fields = [f for f, mode in zip(before, law.mode_mask(p)) if not mode]
    assert [f for f, mode in zip(law.pack_state(z), law.mode_mask(p)) if not mode] == pytest.approx(
        fields, rel=1e-12
    )
    assert math.isfinite(law.step(v, v, 0.0, law.state(p), p, U))


@laws_that(lambda law: law.odd)
@given(motion=motions)
@settings(max_examples=100)
def test_odd(law, motion):
    p = example(law)
    there, _ = drive(law, p, motion)
    back, _ = drive(law, p, [(-v, dt) for v, dt in motion])
    assert there == [-t for t in back]


@laws_that(lambda law: law.steady is not None)
@given(v=speeds)
@settings(max_examples=60)
def test_steady_value_is_reached(law, v):
    assume(abs(v) > 1e-5)
    p, z = example(law), None
    _, z = drive(law, p, [(v, 1e-9)])
    for _ in range(400):
        torque = law.step(v, v, 0.05 * 0.01 / min(abs(v), 0.01), z, p, U)
    assert torque == pytest.approx(law.steady(v, p), rel=1e-9)


@every_law
@given(v=speeds, dt=steps)
@settings(max_examples=100)
def test_exact_at_constant_velocity(law, v, dt):
    """Two half steps are one step while no element breaks away between them."""
    p = example(law)
    whole, halves = law.state(p), law.state(p)
    # Leuven's steps have no closed form: they only agree where the steady value is reached, some 1e-3 rad on.
    leuven = law.name == "leuven"
    for z in (whole, halves):
        for _ in range(3):
            law.step(v, v, max(10.0, 1e-3 / abs(v)) if leuven else 10.0, z, p, U)
    one = law.step(v, v, dt, whole, p, U)
    law.step(v, v, 0.5 * dt, halves, p, U)
    two = law.step(v, v, 0.5 * dt, halves, p, U)
    assert one == pytest.approx(two, rel=1e-6 if leuven else 1e-9, abs=1e-12)


@laws_that(lambda law: law.rate is not None and law.state_fields)
def test_step_converges_to_rate(law):
    """The law's step and its rate are the same law: fine steps follow an accurate solution of the rate."""
    if law.name not in BUILT_IN:
        assert step_against_rate(law).passed, step_against_rate(law)
        return
    apart, _ = step_errors(law, Reference("harmonic", amplitude=2e-3, frequency=2.0))
    errors = [x.max() for x in apart]
    assert errors[1] < 2e-4
    assert errors[1] < errors[0] / 6.0


@laws_that(is_passive)
@given(
    amplitude=st.floats(-5, -2).map(lambda e: 10.0**e),
    frequency=st.floats(-1, 1.5).map(lambda e: 10.0**e),
    drift=st.floats(-1, 1),
)
@settings(max_examples=40)
def test_passive_from_rest(law, amplitude, frequency, drift):
    """Work done on a contact that starts unloaded is never negative."""
    p = example(law)
    n, z, work, torque = 400, law.state(p), 0.0, 0.0
    w = 2 * math.pi * frequency
    dt = 3.0 / frequency / n
    v = 0.0
    for i in range(1, n + 1):
        end = amplitude * w * (math.sin(w * i * dt) + drift * math.sin(0.37 * w * i * dt))
        before, torque = torque, law.step(v, end, dt, z, p, U)
        work += 0.25 * (before + torque) * (v + end) * dt
        v = end
        assert work >= -2e-3 * 0.335 * amplitude


def remaining(law, reference):
    """Share of LuGre's friction that a compensator with gain 0.8 leaves while the reference slides."""
    lugre = plugins.law("lugre")
    speeds = [float(v) for v in reference.sample(np.linspace(0.01, 3.99, 200))[:, 1]]
    friction = np.array([lugre.steady(v, example(lugre)) for v in speeds])
    helped = np.array([steady_of(law, v) for v in speeds])
    return float(np.sqrt(np.mean((friction - 0.8 * helped) ** 2) / np.mean(friction**2)))


REFERENCE = Reference("sine", amplitude=0.5, frequency=0.25)
GAINS = place("PD", 3.8623e-4, 10.0, 0.85)


def rms(compensator=None):
    """RMS error of the position of a plant with friction, rad."""
    axis = RigidAxis(3.8623e-4, Model("lugre", **plugins.law("lugre").example))
    record = simulate(axis, Controller(GAINS, compensator), REFERENCE, 4.0, tolerance=1e-7)
    return record.meta["metrics"]["position_rms_rad"]


@pytest.fixture(scope="module")
def uncompensated():
    return rms()


@every_law
@pytest.mark.parametrize("helper", [Feedforward, Feedback])
def test_compensates(law, helper, uncompensated):
    """As a compensator it lowers the error of a plant with friction to what it leaves of the friction."""
    left = remaining(law, REFERENCE)
    assert rms(helper(Model(law, **law.example), gain=0.8)) < (left + 0.3) * uncompensated


@every_law
def test_is_a_plant(law):
    axis = RigidAxis(3.8623e-4, Model(law, **law.example))
    record = simulate(
        axis,
        Controller(place("PD", 3.8623e-4, 10.0, 0.85)),
        Reference("sine", amplitude=0.5, frequency=0.25),
        2.0,
        tolerance=1e-7,
    )
    energy = record.meta["energy"]
    assert energy["friction_loss"] > 0.0
    speeds = Reference("sine", amplitude=0.5, frequency=0.25).sample(np.linspace(0.0, 2.0, 2001))[:, 1]
    powers = [float(v) * steady_of(law, float(v)) for v in speeds]
    assert energy["friction_loss"] == pytest.approx(np.mean(powers) * 2.0, rel=0.3)
