"""Pre-sliding hysteresis, and what a contact remembers.

Below break-away a contact is a spring with hysteresis (thesis 2.1.2). When a small reversal interrupts a larger one, a
real contact closes the small loop and resumes the outer curve as if nothing had happened: it remembers its turning
points (non-local memory). GMS does so. LuGre, whose only memory is one deflection, does not close the loop, and under a
force that pulses to one side, always below break-away, it drifts where GMS stands still.
"""

from __future__ import annotations

import itertools

import numpy as np

from stickslip import Controller, Gains, Model, Record, Reference, RigidAxis, law, respond, simulate
from stickslip.report.analysis_pictures import Drawn
from stickslip.report.plots import Curve, Panel
from stickslip.report.styles import Style

GMS = Model("gms", **law("gms").example)
LUGRE = Model("lugre", **law("lugre").example)
COLOURS = {"GMS": Style("#0072B2", "-", 1.4), "LuGre": Style("#D55E00", (0, (4, 1.2)), 1.4)}
TURNS = [0.0, 25e-6, -25e-6, 11e-6, -11e-6, 25e-6]  # rad
SPEED = 5e-6  # rad/s, mean


def turning_times() -> list[float]:
    """Return the times of the turning points, s."""
    times = [0.0]
    for start, end in itertools.pairwise(TURNS):
        times.append(times[-1] + abs(end - start) / SPEED)
    return times


def loop(model: Model) -> Record:
    """Move a contact slowly from turning point to turning point."""
    time = turning_times()
    motion = Reference.table(time, TURNS)
    return respond(model, motion, np.linspace(0.0, time[-1], 3001), tolerance=1e-9)


def gap(record: Record) -> float:
    """Torque where the interruption began less torque where its loop comes back there, N·m."""
    *_, third, last, _ = turning_times()
    began = float(np.interp(third, record.time, record["friction_torque"]))
    back = record.time > last
    return float(began - np.interp(TURNS[3], record["position"][back], record["friction_torque"][back]))


def pulsed(model: Model, duration: float = 20.0) -> Record:
    """The axis under a torque that pulses between 0.05 and 0.25 N·m, three quarters of the break-away torque."""
    w = 2.0 * np.pi * 1.0
    # A controller without gain but on the reference's velocity passes a torque on.
    torque = Reference("harmonic", amplitude=0.10 / w, frequency=1.0, phase=-0.5 * np.pi, velocity=0.15)
    axis = RigidAxis(3.8623e-4, model)
    return simulate(
        axis, Controller(Gains(kp=0.0, kr=1.0)), torque, duration, integrator="adaptive", output=5e-3
    )


def drift(record: Record) -> float:
    """Creep from one period to the next over the second half of a run, rad/s."""
    half, end = 0.5 * record.time[-1], record.time[-1]
    then, now = np.interp([half, end], record.time, record["position"])
    return float((now - then) / (end - half))


def picture() -> Drawn:
    """Draw the loops and the drift."""
    loops = {name: loop(model) for name, model in (("GMS", GMS), ("LuGre", LUGRE))}
    pulses = {name: pulsed(model) for name, model in (("GMS", GMS), ("LuGre", LUGRE))}
    panels = [
        Panel(
            [Curve(1e6 * r["position"], r["friction_torque"], "", COLOURS[name])],
            "torque (N·m)",
            "position (µrad)",
            (-28.0, 28.0),
            note=f"{name}: the small loop ends {1e3 * abs(gap(r)):.2g} mN·m from where it began",
        )
        for name, r in loops.items()
    ]
    panels.append(
        Panel(
            [Curve(r.time, 1e6 * r["position"], name, COLOURS[name]) for name, r in pulses.items()],
            "position (µrad)",
            "time (s)",
            note="torque pulsing between 0.05 and 0.25 N·m at 1 Hz",
            legend="upper left",
        )
    )
    creep = {name: f"{1e6 * drift(record):.2g}" for name, record in pulses.items()}
    message = (
        f"Under the pulsing torque LuGre creeps by {creep['LuGre']} µrad/s, GMS by {creep['GMS']} µrad/s"
    )
    return "Hysteresis, memory and drift in pre-sliding", message, panels, 1.9
