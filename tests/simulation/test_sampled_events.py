"""Events inside a sample of the sampled engine, against independent ways to find them: none is missed, none leapt."""

from __future__ import annotations

import math

import numpy as np
import pytest

import stickslip as ss
from stickslip.simulation.closed_loop import prepare
from stickslip.simulation.exact.flow import linear
from stickslip.simulation.sampled.axis import axis_of
from stickslip.simulation.sampled.modes import gather
from stickslip.simulation.sampled.rates import SLIPS, STUCK
from stickslip.simulation.sampled.slip import slip
from stickslip.simulation.sampled.stick import Swing, first_break, stick

J, TIME = 3.8623e-4, 1e-3
K, SHARE, C = [1e4, 7e3, 5e3, 3e3], 0.25, 24.0
FS, FC, VS, SIGMA2 = 0.335, 0.285, 0.01, 0.018
GMS = ss.Model("gms", k=K, alpha=[SHARE] * 4, c=C, fs=FS, fc=FC, vs=VS, sigma2=SIGMA2)
PD = ss.Controller(ss.place("PD", J, 36.0, 1.0), None, 1.0, TIME)


def s(v):
    return FC + (FS - FC) * math.exp(-((v / VS) ** 2))


CASE = prepare(ss.RigidAxis(J, GMS), PD, ss.Reference("step", amplitude=0.1), 0.1, metered=False)


def laid_out():
    """The axis, its state and its elements as records."""
    axis, state, springs = axis_of(CASE)
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
    left = TIME
    while left > 0.0:
        taken = (stick if z["mode"] == STUCK else slip)(axis, z, left)
        left = left - taken if left - taken > 1e-12 * TIME else 0.0
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
