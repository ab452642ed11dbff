"""The controllers of the reference's golden traces, by the names of its rows."""

from __future__ import annotations

import math

from stickslip.control.block import ControlBlock
from stickslip.control.controller import Controller
from stickslip.control.registry import control_law
from stickslip.models.model import Model

INERTIA = 3.8623e-4
W = 2.0 * math.pi * 20.0
PD = {"kp": INERTIA * W**2, "kd": 2.0 * INERTIA * W}
PID = {"kp": 3.0 * INERTIA * W**2, "kd": 3.0 * INERTIA * W, "ki": INERTIA * W**3}
CURVE = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "sigma2": 0.018}
LUGRE = Model("lugre", sigma0=3.5e4, sigma1=0.0, **CURVE)
GMS = Model("gms", k=[12896.0, 8141.0, 4273.0], alpha=[1 / 3] * 3, c=23.8782, **CURVE)


def controller(loop, feedforward=None, observer=None, alone=False):
    return Controller(
        loop=loop, sample_time=1e-3, feedforward=feedforward, observer=observer, torque_limit=1.0, alone=alone
    )


def pd():
    return ControlBlock("pd", **PD)


def pid(choices=None, **more):
    return ControlBlock("pid", None, choices, **PID, **more)


def compensation(model):
    return ControlBlock("friction_feedforward", model, {"velocity": "held"}, gain=0.9)


def observer(corner, **choices):
    return ControlBlock("disturbance_observer", None, choices, inertia=INERTIA, corner=corner)


def extended(corner):
    return ControlBlock("extended_state_observer", inertia=INERTIA, corner=corner)


def coulomb(direction, smooth):
    return ControlBlock(
        "coulomb_observer", None, {"direction": direction}, inertia=INERTIA, sigma2=0.018, corner=200.0, deadband=0.01,
        smooth=smooth, largest=0.6,
    )  # fmt: skip


def late(model, correction=0.0):
    return ControlBlock("friction_observer", model, correction=correction, sigma2=0.018)


def bristle(correction, sigma0=3.5e4):
    return ControlBlock("lugre_observer", sigma0=sigma0, correction=correction, **CURVE)


def scaled(model):
    return ControlBlock(
        "scaled_feedforward",
        model,
        inertia=INERTIA,
        gain=0.9,
        sigma2=0.018,
        corner=200.0,
        rate=5.0,
        slowest=0.015,
    )


def least_squares(model):
    return ControlBlock(
        "least_squares_feedforward", model, inertia=INERTIA, fc=0.285, sigma2=0.018, gain=0.9, corner=200.0, speed=0.1,
        slowest=0.015,
    )  # fmt: skip


def robust(inertia_rate):
    return ControlBlock(
        "robust_adaptive", inertia=INERTIA, slope=0.5 * W, damping=PD["kd"], layer=0.5, inertia_rate=inertia_rate,
        level_rate=20.0, speed_rate=20.0, leak=0.02, most_level=1e6, most_speed=1e6, most_inertia=1e6,
    )  # fmt: skip


def learnt(functions, leak=0.05, **more):
    example = control_law("adaptive_friction").having(functions=functions).example
    values = {**example, "slope": 0.5 * W, "leak": leak, "largest": 100.0, **more}
    return ControlBlock("adaptive_friction", None, {"functions": functions}, **values)


GRADIENT = ControlBlock("gradient_feedforward", LUGRE, gain=0.9, rate=100.0, slope=60.0)


def twisting(form):
    return ControlBlock("super_twisting", None, {"form": form}, inertia=INERTIA, slope=60.0, rate=2e4)


def layer(width):
    return ControlBlock("boundary_layer", inertia=INERTIA, slope=0.5 * W, torque=0.45, layer=width)


PUSH = ControlBlock("stiction_push", torque=0.9 * 0.335, error=2e-3, speed=0.02)
DITHER = ControlBlock("dither", torque=0.2, samples=4.0)

ROWS = {
    "PD": controller(pd()),
    "PID": controller(pid()),
    "PD + FF LuGre .9": controller(pd(), compensation(LUGRE)),
    "PID + FF LuGre .9": controller(pid(), compensation(LUGRE)),
    "PD + FF GMS3 .9": controller(pd(), compensation(GMS)),
    "PID + FF GMS3 .9": controller(pid(), compensation(GMS)),
    "PD + DOB 200": controller(pd(), None, observer(200.0)),
    "PD + DOB 400": controller(pd(), None, observer(400.0)),
    "PD + DOB 800": controller(pd(), None, observer(800.0)),
    "PD + DOB 400 aligned": controller(pd(), None, observer(400.0, aligned="yes")),
    "PD + DOB2 400": controller(pd(), None, observer(400.0, order="second")),
    "PD + FF LuGre .9 + DOB 200 residual": controller(pd(), compensation(LUGRE), observer(200.0)),
    "PD + FF LuGre .9 + DOB 400 residual": controller(pd(), compensation(LUGRE), observer(400.0)),
    "PD + FF LuGre .9 + DOB 400 aligned residual": controller(
        pd(), compensation(LUGRE), observer(400.0, aligned="yes")
    ),
    "PD + FF LuGre .9 + DOB 400 whole (wrong)": controller(
        pd(), compensation(LUGRE), observer(400.0, fed_with="whole")
    ),
    "PD + FF GMS3 .9 + DOB 400 residual": controller(pd(), compensation(GMS), observer(400.0)),
    "PID reset at rest": controller(pid({"at_rest": "reset"})),
    "PID dead band 2e-4 at rest": controller(pid({"at_rest": "dead_band"}, dead_band=2e-4)),
    "PD + DOB 400 reset at rest": controller(pd(), None, observer(400.0, at_rest="reset")),
    "PD + FF LuGre .9 + DOB 400 residual reset at rest": controller(
        pd(), compensation(LUGRE), observer(400.0, at_rest="reset")
    ),
    "PD + ESO 400": controller(pd(), None, extended(400.0)),
    "PD + ESO 800": controller(pd(), None, extended(800.0)),
    "PD + Friedland-Park 200 on v_d": controller(pd(), None, coulomb("reference", 1e-3)),
    "PD + Friedland-Park 200 on v_f": controller(pd(), None, coulomb("measured", 0.01)),
    "PD + GMS3 feedback on v_f k=0": controller(pd(), None, late(GMS)),
    "sliding mode phi .05": controller(layer(0.05)),
    "sliding mode phi .5": controller(layer(0.5)),
    "super-twisting 2e4": controller(twisting("explicit")),
    "super-twisting 2e4 implicit": controller(twisting("implicit")),
    "PD + stiction push": controller(pd(), None, PUSH),
    "PD + DOB 400 w-form": controller(pd(), None, observer(400.0, form="textbook")),
    "PD + LuGre observer k=1": controller(pd(), None, bristle(1.0)),
    "PD + LuGre observer k=10": controller(pd(), None, bristle(10.0)),
    "PD + LuGre observer k=1 sigma0 500": controller(pd(), None, bristle(1.0, 500.0)),
    "PD + GMS3 observer on v_f k=1": controller(pd(), None, late(GMS, 1.0)),
    "PD + FF LuGre .9 scale adapted": controller(pd(), scaled(LUGRE), alone=True),
    "PD + FF LuGre .9 scale adapted + DOB 200 residual": controller(pd(), scaled(LUGRE), observer(200.0)),
    "PD + FF GMS3 .9 scale adapted + DOB 200 residual": controller(pd(), scaled(GMS), observer(200.0)),
    "PD + FF LuGre .9 RLS + DOB 200 residual": controller(pd(), least_squares(LUGRE), observer(200.0)),
    "PD + FF LuGre gradient gain": controller(pd(), GRADIENT, alone=True),
    "Lee-Kim delta .5": controller(robust(0.0), alone=True),
    "Lee-Kim delta .5 mass adapted": controller(robust(0.01), alone=True),
    "PD + two-line adaptive": controller(pd(), None, learnt("lines"), alone=True),
    "PD + Makkar adaptive": controller(pd(), None, learnt("makkar"), alone=True),
    "PD + RBF 21 adaptive": controller(pd(), None, learnt("gaussians", 0.01), alone=True),
    "PD + dither .2": controller(pd(), DITHER),
    "PID + dither .2": controller(pid(), DITHER),
}
