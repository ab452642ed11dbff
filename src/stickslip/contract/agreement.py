"""Whether a law's functions are one law: step and rate, steady, and the elements or bristle of its located flow."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.contract.motions import Array, U, example
from stickslip.contract.verdict import Verdict, failed, held, not_tried
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.core.errors import StickslipError
from stickslip.core.spec import Bristle, Law
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate
from stickslip.simulation.prescribed.open_loop import respond

LONG, POINTS = 0.6, 60
"""Length of the motion, s, and the moments at which its torques are compared."""
COARSE, FINE = 2400, 9600
"""Steps over it."""
ENOUGH, MOST, SHRINKS = 2e-3, 2e-2, 2.5
"""Share of the largest torque by which fine steps may differ from the rate; more, up to MOST, where they come nearer
with every refinement."""
OUTLIERS = 0.05
"""Share of the moments that may lie on a jump of a torque that is not continuous."""
SAME_LOOP = 1e-6, 1e-3
"""What positions of the exact integrator may differ by from the adaptive one, and from fine fixed steps, over the
amplitude of the reference."""


def step_errors(law: Law, reference: Reference) -> tuple[list[Array], float]:
    """What the law's steps along a motion are off an accurate solution of its rate, N·m, and the largest torque.

    One array of shape (POINTS,) for `COARSE` and `FINE` steps each.
    """
    p, length = example(law), LONG
    times = np.linspace(0.0, length, POINTS + 1)
    fine = respond(Model(law, **dict(law.example)), reference, times, method="rate", tolerance=1e-10)[
        "friction_torque"
    ]
    apart: list[Array] = []
    for n in (COARSE, FINE):
        z, dt, v = law.state(p), length / n, float(reference.sample([0.0])[0, 1])
        grid = reference.sample(np.arange(n + 1) * dt)[:, 1]
        torque = np.zeros(n + 1)
        for i in range(n):
            torque[i + 1] = law.step(v, float(grid[i + 1]), dt, z, p, U)
            v = float(grid[i + 1])
        apart.append(np.abs(torque[:: n // POINTS][1:] - fine[1:]))
    return apart, float(np.abs(fine).max())


def step_against_rate(law: Law) -> Verdict:
    """Fine steps follow an accurate solution of the rate."""
    name = "step and rate"
    if law.rate is None or not law.state_fields:
        return not_tried(name, "no rate to integrate" if law.rate is None else "no state to integrate")
    motion = Reference("harmonic", amplitude=max(2e-3, 5.0 * _way(law)), frequency=2.0)
    try:
        apart, largest = step_errors(law, motion)
    except StickslipError as error:
        return failed(name, f"the rate cannot be integrated: {error}")
    kept = POINTS if law.continuous else int((1.0 - OUTLIERS) * POINTS)
    coarse, fine = (float(np.sort(x)[kept - 1]) / largest for x in apart)
    said = f"{FINE} steps differ from the rate's solution by {fine:.2g} of the largest torque, {COARSE} by {coarse:.2g}"
    good = fine <= ENOUGH or (fine <= MOST and fine <= coarse / SHRINKS)
    return held(name, said) if good else failed(name, said)


def _way(law: Law) -> float:
    """Way over which a contact at rest breaks away, about, rad."""
    p = example(law)
    z, tiny = law.state(p), 1e-9
    slope = abs(law.step(tiny, tiny, 1.0, z, p, U)) / tiny
    return _level(law) / slope if slope > 0.0 else 0.0


def _level(law: Law) -> float:
    """The largest torque over a slow slide from rest, N·m."""
    p = example(law)
    z = law.state(p)
    return max(abs(law.step(1e-3, 1e-3, 1e-3, z, p, U)) for _ in range(2000))


def steady_is_reached(law: Law) -> Verdict:
    """The torque at constant velocity comes to what `steady` says."""
    name = "steady"
    if law.steady is None:
        return not_tried(name, "the law gives no torque at constant velocity")
    p, worst = example(law), 0.0
    level = _level(law)
    for v in (-1.0, -1e-2, -1e-3, 1e-4, 1e-3, 3e-2, 1.0):
        z, torque = law.state(p), 0.0
        for _ in range(400):
            torque = law.step(v, v, 5e-4 / min(abs(v), 0.01), z, p, U)
        want = law.steady(v, p)
        apart = abs(torque - want) / max(abs(want), level)
        if not apart <= 1e-3:
            return failed(name, f"step comes to {torque:.6g} N·m at {v:g} rad/s, steady says {want:.6g}")
        worst = max(worst, apart)
    return held(name, f"reached at 7 velocities, to {worst:.1g} of it")


def modes_against_rate(law: Law) -> Verdict:
    """A closed loop on the elements, by the exact integrator, and by one that runs the law's own functions.

    A bristle with a growth of its own, which only the sampled integrator takes, is compared along a motion.
    """
    name = "modes"
    form = law.modes(example(law)) if law.modes else None
    if form is None:
        return not_tried(name, "the law is not given as elements")
    if isinstance(form, Bristle) and form.own_growth:
        return growth_against_step(law, form)
    level = _level(law)
    frequency, amplitude = 20.0, max(0.02, 5.0 * _way(law))
    # So heavy that the controller overcomes the friction five times.
    inertia = 5.0 * level / (amplitude * (2.0 * math.pi * frequency) ** 2)
    axis = RigidAxis(inertia, Model(law, **dict(law.example)))
    loop = Controller(place("PD", inertia, frequency, 0.85))
    motion = Reference("sine", amplitude=amplitude, frequency=2.0)
    other = "adaptive" if law.rate else "fixed"
    try:
        found: list[Any] = [
            simulate(axis, loop, motion, 0.5, integrator=how, time_step=1e-5, metered=False)
            for how in ("exact", other)
        ]
    except StickslipError as error:
        return not_tried(name, str(error))
    times = np.arange(500) * 1e-3
    positions: list[Array] = [np.interp(times, r.time, r["position"]) for r in found]
    apart = float(np.abs(positions[1] - positions[0]).max()) / amplitude
    said = f"the elements move an axis as {'the rate' if law.rate else 'fine steps'} to {apart:.1g} of the amplitude"
    return held(name, said) if apart <= SAME_LOOP[other == "fixed"] else failed(name, said)


def growth_against_step(law: Law, form: Bristle) -> Verdict:
    """A bristle that its growth bends to and fro at constant speeds has the torque of the law's own steps."""
    name, p = "modes", example(law)
    if law.growth is None or law.steady is None:
        return failed(
            name, "`modes` says that the bristle has a `growth` of its own; give `growth` and `steady`"
        )
    dx = 0.02 * form.breakaway / form.stiffness
    z, force, worst, level = law.state(p), 0.0, 0.0, _level(law)
    for v in (1e-3, -1e-4, 3e-2, -1.0, 1e-3):
        limit = form.breakaway if form.constant_curve else abs(law.steady(v, p) - form.viscous * v)
        for _ in range(150):
            torque = law.step(v, v, dx / abs(v), z, p, U)
            k1 = bending(law, p, form, force, v, limit)
            k2 = bending(law, p, form, force + 0.5 * dx * k1, v, limit)
            k3 = bending(law, p, form, force + 0.5 * dx * k2, v, limit)
            k4 = bending(law, p, form, force + dx * k3, v, limit)
            force += dx / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
            damped = form.damping / form.stiffness * abs(v) * bending(law, p, form, force, v, limit)
            worst = max(worst, abs(torque - force - damped - form.viscous * v) / level)
    said = f"its growth bends the bristle as the law's steps do, to {worst:.1g} of the level"
    return held(name, said) if worst <= ENOUGH else failed(name, said)


def bending(law: Law, p: Any, form: Bristle, force: float, v: float, limit: float) -> float:
    """dF over the distance slid, N·m/rad, of a bristle with a growth of its own."""
    way = math.copysign(1.0, v)
    if form.elastic > 0.0 and way * force < form.elastic:
        return way * form.stiffness
    assert law.growth is not None
    return way * form.stiffness * law.growth(way * force / form.stiffness, limit / form.stiffness, p)
