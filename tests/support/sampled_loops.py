"""Axes, controllers and independent motions for the tests of the sampled engine."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.simulation.closed_loop import prepare

J, TIME = 3.8623e-4, 1e-3
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
GMS = ss.Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **CURVE)
LUGRE = ss.Model("lugre", sigma0=3.5e4, sigma1=0.1, **CURVE)
LAWS = {
    "gms": GMS,
    "gms, literal": GMS.having(slip_rule="literal"),
    "gms, Table 10": ss.Model(
        "gms", {"curve": "double_stribeck"}, k=[1e4, 5e3], alpha=[0.5, 0.5], c=24.0, sigma2=0.01,
        beta0=80.7454, beta1=-80.4742, beta2=-80.5930, beta3=0.7884, beta4=0.7871, v1=0.1755, v2=0.1758,
    ),
    "lugre": LUGRE,
    "maxwell_slip": ss.Model("maxwell_slip", k=[1e4, 7e3, 5e3, 3e3], w=[0.05, 0.08, 0.09, 0.1], sigma2=0.018),
    "coulomb": ss.Model("coulomb", fc=0.285, sigma2=0.018),
    "stribeck": ss.Model("stribeck", k=3.5e4, **CURVE),
    "dahl": ss.Model("dahl", sigma0=3.5e3, fc=0.285, sigma2=0.018),
    "dahl, ductile": ss.Model("dahl", sigma0=3.5e3, fc=0.285, sigma2=0.018, delta_d=2.0),
    "elasto_plastic": ss.Model("elasto_plastic", sigma0=3.5e4, sigma1=0.1, z_ba=4e-6, **CURVE),
}  # fmt: skip
W = 2.0 * math.pi * 20.0
LINEAR = {
    "PD": ss.ControlBlock("pd", kp=J * W**2, kd=2.0 * J * W),
    "PID": ss.ControlBlock("pid", kp=3.0 * J * W**2, kd=3.0 * J * W, ki=J * W**3),
}
HELP = ss.ControlBlock(
    "friction_feedforward",
    ss.Model("lugre", sigma0=3.5e4, sigma1=0.0, **CURVE),
    {"velocity": "held"},
    gain=0.9,
)


def observer(corner):
    return ss.ControlBlock("disturbance_observer", inertia=J, corner=corner)


ROWS = {
    name: ss.Controller(
        loop=LINEAR[loop], sample_time=TIME, feedforward=helper, observer=watcher, torque_limit=1.0
    )
    for name, (loop, helper, watcher) in {
        "PD": ("PD", None, None),
        "PID": ("PID", None, None),
        "PD + FF LuGre .9": ("PD", HELP, None),
        "PID + FF LuGre .9": ("PID", HELP, None),
        "PD + DOB 200": ("PD", None, observer(200.0)),
        "PD + DOB 400": ("PD", None, observer(400.0)),
        "PD + DOB 800": ("PD", None, observer(800.0)),
        "PD + FF LuGre .9 + DOB 400 residual": ("PD", HELP, observer(400.0)),
    }.items()
}
"""Controllers by the names of the rows of the reference."""
LOW = ss.Reference("sine", amplitude=0.01, frequency=0.4)
HIGH = ss.Reference("sine", amplitude=0.5, frequency=0.1)
FAST = ss.Reference("sine", amplitude=0.05, frequency=4.0)
PD, PID = (ss.place(kind, J, 36.0, 1.0) for kind in ("PD", "PID"))
CONTROLLERS = {
    "PD": ss.Controller(PD, None, 1.0, TIME),
    "PID with an encoder": ss.Controller(PID, None, 1.0, TIME, 1e6),
    "feedforward": ss.Controller(PD, ss.Feedforward(LUGRE, 0.9), 1.0, TIME),
    "feedback at its limit": ss.Controller(PD, ss.Feedback(GMS, 0.8), 0.4, TIME),
    "cascade": ss.Controller(ss.Cascade(60.0, 0.05, 1.0), None, 1.0, TIME),
    "control laws": ROWS["PD + FF LuGre .9 + DOB 400 residual"],
}


def case_of(law, controller, reference=FAST, duration=0.3, **more):
    return prepare(ss.RigidAxis(J, law), controller, reference, duration, **{"metered": False, **more})


def on_grid(outcome):
    return outcome.rows[outcome.rows[:, 8] == 0.0]


def apart(one, other):
    return np.abs(on_grid(one)[:, 3] - on_grid(other)[:, 3]).max()


def up_to_a_turn(rate, t, y, side):
    """Time and state by DOP853 at the end of a sample, or where the velocity y[1], of that sign, falls to 0."""

    def turned(_, y):
        return side * y[1] if abs(y[1]) > 1e-13 else 1e-13

    turned.terminal, turned.direction = True, -1
    run = solve_ivp(rate, (t, TIME), y, "DOP853", rtol=1e-12, atol=1e-14, events=turned, max_step=1e-4)
    end = run.y[:, -1]
    if run.status == 1:
        end[1] = 0.0
    return run.t[-1], end


def moved_by(torques, contact):
    """Positions at every sample under held torques, by DOP853 stopped at every reversal.

    ``contact(v, z, side)`` is friction, N·m, and the rate of its state z.
    """
    out, velocity, z = [0.0], 0.0, 0.0
    for u in torques:
        t, y = 0.0, [out[-1], velocity, z]
        while t < TIME:
            side = math.copysign(1.0, y[1] if y[1] != 0.0 else u - contact(0.0, y[2], 1.0)[0])

            def rate(_, y, u=u, side=side):
                friction, dz = contact(y[1], y[2], side)
                return [y[1], (u - friction) / J, dz]

            t, y = up_to_a_turn(rate, t, y, side)
        _, velocity, z = y
        out.append(y[0])
    return np.array(out)
