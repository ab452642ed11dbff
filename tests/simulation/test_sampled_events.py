"""Events inside a sample of the sampled engine, against independent ways to find them: none is missed, none leapt."""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import brentq

import stickslip as ss
from stickslip.simulation.case_arrays import DONE
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.exact.flow import linear
from stickslip.simulation.sampled import engine as sampled
from stickslip.simulation.sampled.axis import axis_of
from stickslip.simulation.sampled.modes import gather
from stickslip.simulation.sampled.order_eight import attempt
from stickslip.simulation.sampled.rates import BENDS, RELAXES, SLIPS, STUCK, slip_of, start_of
from stickslip.simulation.sampled.slip import at_velocity, slip
from stickslip.simulation.sampled.stick import Swing, after, first_break, stick, turning_time

J, TIME = 3.8623e-4, 1e-3
K, SHARE, C = [1e4, 7e3, 5e3, 3e3], 0.25, 24.0
FS, FC, VS, SIGMA2 = 0.335, 0.285, 0.01, 0.018
GMS = ss.Model("gms", k=K, alpha=[SHARE] * 4, c=C, fs=FS, fc=FC, vs=VS, sigma2=SIGMA2)
PD = ss.Controller(ss.place("PD", J, 36.0, 1.0), None, 1.0, TIME)


def s(v):
    return FC + (FS - FC) * math.exp(-((v / VS) ** 2))


FAST = ss.Reference("step", amplitude=0.1)
CASE = prepare(ss.RigidAxis(J, GMS), PD, FAST, 0.1, metered=False)


def laid_out(case=CASE):
    """The axis, its state and its elements as records."""
    axis, state, springs = axis_of(case)
    return axis[0], state[0], springs


# ---- break-away while all stick ------------------------------------------------------------------------------------


def about_to_turn(rng):
    """One load near the curve, some v_s and a torque that soon turns the axis: forces, N·m; v, rad/s; u, N·m."""
    forces = SHARE * FS * rng.uniform(-0.4, 0.3, 4)
    forces[0] = SHARE * FS * rng.uniform(0.7, 0.95)
    return forces, rng.uniform(0.01, 0.04), forces.sum() + rng.uniform(-0.1, 0.02)


def first_seen(forces, lin, goal, v):
    """When a load lies above the curve first, on a fine grid, s; and how far one ever does, N·m."""
    t = np.linspace(0.0, TIME, 50_001)[1:]
    decay = np.exp(-lin.decay * t)
    c, w = decay * np.cos(lin.frequency * t), decay * np.sin(lin.frequency * t) / lin.frequency
    e = w * v - (c + w * lin.decay) * goal
    velocity = c * v + w * (lin.square * goal - lin.decay * v)
    loads = np.sign(velocity)[:, None] * (forces + np.multiply.outer(goal + e, K))
    above = loads.max(axis=1) / SHARE - FC - (FS - FC) * np.exp(-((velocity / VS) ** 2))
    return (t[np.argmax(above >= 0.0)] if above.max() >= 0.0 else math.inf), above.max()


def test_a_load_above_the_curve_for_a_moment_before_the_axis_turns_breaks_away():
    """The curve is low at some v_s and rises as the axis slows down: a load may lie above it for microseconds."""
    axis, _, springs = laid_out()
    lin, rng, short = linear(J, SIGMA2, sum(K)), np.random.default_rng(19), 0
    for _ in range(300):
        forces, v, u = about_to_turn(rng)
        springs["force"], springs["slips"] = forces, 0.0
        goal = (u - forces.sum()) / sum(K)
        seen, most = first_seen(forces, lin, goal, v)
        if forces.max() / SHARE >= s(v) or abs(most) < 1e-6:  # where the grid does not tell
            continue
        found, way = first_break(axis, Swing(lin, goal, -goal, v), TIME)
        assert (way != 0.0) == math.isfinite(seen)
        assert way == 0.0 or found == pytest.approx(seen, abs=3e-8)
        short += 0.0 < most < 0.01
    assert short >= 5


def speed_after(t, swing):
    return after(swing, t).velocity


def test_a_free_motion_turns_where_its_velocity_vanishes():
    """Every turn of a swing of a few periods, by its closed form, against the velocity's own zeros."""
    lin, rng = linear(J, SIGMA2, sum(K)), np.random.default_rng(5)
    for _ in range(100):
        swing = Swing(lin, 0.0, rng.normal(0.0, 1e-5), rng.normal(0.0, 0.1))
        times = np.linspace(1e-7, 3e-3, 40)
        velocities = [after(swing, t).velocity for t in times]
        turns = 0
        for low, high, v0, v1 in zip(times, times[1:], velocities, velocities[1:]):
            if v0 * v1 < 0.0:
                exact = brentq(speed_after, low, high, (swing,), xtol=1e-18)
                found = turning_time(swing, low, high, math.copysign(1.0, v0))
                assert found == pytest.approx(exact, rel=1e-9)
                turns += 1
        assert turns >= 6


# ---- a step that ends near a turn ----------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", [RELAXES, BENDS])
def test_an_end_nearby_is_led_to_a_velocity_with_order_four(kind):
    """Against the step of order 8 from the same start to the time that was found, from ends ever nearer."""
    law = (
        GMS
        if kind == RELAXES
        else ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, fs=FS, fc=FC, vs=VS, sigma2=SIGMA2)
    )
    axis, z, _ = laid_out(prepare(ss.RigidAxis(J, law), PD, FAST, 0.1, metered=False))
    z["mode"], z["direction"], z["velocity"], z["torque"] = SLIPS, 1.0, 0.02, 0.0
    z["slipping"], z["share"], z["spring"] = (0.9 * FC, 1.0, 0.0) if kind == RELAXES else (0.5 * FC, 0.0, 0.0)
    m = slip_of(axis, z)
    start = start_of(m, z)
    end = attempt(m, start, 2e-6)
    off = []
    for part in (0.2, 0.1, 0.05):
        found = at_velocity(m, end, end.velocity * (1.0 - part), TIME)
        exact = attempt(m, start, found.time)
        assert found.velocity == end.velocity * (1.0 - part)
        assert abs(found.velocity - exact.velocity) * TIME <= max(found.error, 1e-18)
        off.append(abs(found.velocity - exact.velocity) + 1e-18)
    assert off[2] < off[0] / 100.0 or off[0] < 1e-14


# ---- a sample, in which anything may happen ------------------------------------------------------------------------


def rates(x, way, slips, u):
    """Of displacement, velocity and the elements' forces."""
    v = x[1]
    level, force = s(v), sum(x[2:])
    of = [
        C * (SHARE * way - f / level) if slip else k * v for f, k, slip in zip(x[2:], K, slips, strict=True)
    ]
    return [v, (u - force - SIGMA2 * v) / J, *of]


def stepped(x, way, slips, u, h):
    """The classical step of order four."""
    a = rates(x, way, slips, u)
    b = rates([p + 0.5 * h * q for p, q in zip(x, a, strict=True)], way, slips, u)
    c = rates([p + 0.5 * h * q for p, q in zip(x, b, strict=True)], way, slips, u)
    d = rates([p + h * q for p, q in zip(x, c, strict=True)], way, slips, u)
    return [p + h / 6.0 * (q + 2.0 * r + 2.0 * t + w) for p, q, r, t, w in zip(x, a, b, c, d, strict=True)]


def due(x, way, slips):
    return x[1] * way < 0.0 or any(
        not slip and way * f >= SHARE * s(x[1]) for f, slip in zip(x[2:], slips, strict=True)
    )


def in_small_steps(forces, slips, v, u, h=2e-6):
    """Displacement and velocity after a sample, in steps of `h` that are halved down to every event."""
    x, way, slips, t = [0.0, v, *forces], math.copysign(1.0, v), list(slips), 0.0
    while t < TIME:
        step = min(h, TIME - t)
        end = stepped(x, way, slips, u, step)
        if due(end, way, slips):
            low, high = 0.0, step
            while high - low > 1e-18 and low < 0.5 * (low + high) < high:
                middle = 0.5 * (low + high)
                low, high = (
                    (low, middle) if due(stepped(x, way, slips, u, middle), way, slips) else (middle, high)
                )
            step, end = high, stepped(x, way, slips, u, high)
        x, t = end, t + step
        if x[1] * way < 0.0:
            way, slips = -way, [False] * 4
        slips = [slip or way * f >= SHARE * s(x[1]) for f, slip in zip(x[2:], slips, strict=True)]
    return x[0], x[1]


def by_the_engine(forces, slips, v, u):
    axis, z, springs = laid_out()
    springs["force"], springs["slips"] = forces, slips
    z["velocity"], z["torque"], z["direction"] = v, u, math.copysign(1.0, v)
    z["mode"] = SLIPS if any(slips) else STUCK
    gather(axis, z)
    left, pieces = TIME, 0
    while left > 0.0:
        taken = (stick if z["mode"] == STUCK else slip)(axis, z, left)
        left, pieces = left - taken if left - taken > 1e-12 * TIME else 0.0, pieces + 1
        assert pieces < 1000, "it gets nowhere"
    return z["position"] + z["moved"], z["velocity"]


def test_a_sample_with_turns_and_break_away_is_that_of_small_steps():
    """A step that ends where the axis turns meets the curve's peak there, over which a whole sample may have leapt."""
    rng = np.random.default_rng(5)
    for _ in range(60):
        slipping = int(rng.integers(0, 5))
        slips = [j < slipping for j in range(4)]
        v = rng.uniform(0.05, 0.3) if slipping == 4 else rng.uniform(0.005, 0.06)
        forces = SHARE * np.where(slips, rng.uniform(0.85, 1.1, 4) * FC, rng.uniform(-0.5, 0.8, 4) * FC)
        u = rng.uniform(-0.15, 0.4)
        position, velocity = in_small_steps(forces, slips, v, u)
        found, speed = by_the_engine(forces, slips, v, u)
        assert found == pytest.approx(position, rel=0.0, abs=1e-12)
        assert speed == pytest.approx(velocity, rel=0.0, abs=1e-9)


def test_loads_that_reach_the_curve_together_while_the_axis_hardly_moves_let_time_pass():
    """Three elements at their shares and an axis that creeps: after 1.249 s, a loop once never got on."""
    w = 2.0 * math.pi * 20.0
    helper = ss.ControlBlock(
        "friction_feedforward",
        ss.Model("lugre", sigma0=3.5e4, sigma1=0.0, fs=FS, fc=FC, vs=VS, sigma2=SIGMA2),
        {"velocity": "held"},
        gain=0.9,
    )
    controller = ss.Controller(
        loop=ss.ControlBlock("pd", kp=J * w**2, kd=2.0 * J * w),
        sample_time=TIME,
        feedforward=helper,
        torque_limit=1.0,
    )
    axis, slow = (
        ss.RigidAxis(J, GMS),
        ss.Reference("sine", amplitude=0.01, frequency=0.4),
    )
    outcome = sampled.run(prepare(axis, controller, slow, 1.3, metered=False))
    assert outcome.code == DONE
    assert outcome.counts["steps"] < 5000


def test_an_element_at_its_limit_on_an_axis_in_balance_stays():
    """Rounding of the balance lets it go, and stops the axis at once: a loop came to rest without an end."""
    rng = np.random.default_rng(3)
    for _ in range(300):
        forces = SHARE * FS * rng.uniform(-1.0, 1.0, 4)
        forces[0] = SHARE * FS * (1.0 + rng.uniform(-2.0, 2.0) * 1e-16)
        u = math.fsum(forces) + rng.uniform(-3.0, 3.0) * 1e-17
        position, velocity = by_the_engine(forces, [False] * 4, 0.0, u)
        assert abs(position) < 1e-18
        assert abs(velocity) < 1e-15


@pytest.mark.parametrize("amplitude", [0.022, 0.0444, 0.05, 0.0564, 0.0612])
def test_a_loop_that_sticks_with_elements_creeping_to_their_limits_has_an_end(amplitude):
    controller = ss.Controller(ss.Gains(kp=6.1, kd=0.097), torque_limit=1.0, sample_time=TIME)
    reference = ss.Reference("step", amplitude=amplitude, tau=0.02)
    outcome = sampled.run(prepare(ss.RigidAxis(J, GMS), controller, reference, 5.0, metered=False))
    assert outcome.code == DONE
    assert outcome.counts["steps"] < 20_000
    assert np.ptp(outcome.rows[outcome.rows[:, 0] > 4.0][:, 3]) < 1e-12
