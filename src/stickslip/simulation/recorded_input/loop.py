"""The loop over a record's samples: what drives the axis, and what is kept of its motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel, pointer
from stickslip.simulation.recorded_input.contact import (
    BACK_EMF,
    BACKLASH,
    DRIVE_GAIN,
    HOLDS,
    INERTIA,
    LOSS,
    PUSH,
    SCALED_BY_LOAD,
    Plant,
    load_of,
    share,
)
from stickslip.simulation.recorded_input.step import LEAST, MOTION, ROUNDING, two_stages
from stickslip.simulation.root import ROOT, compiled

# ---- the drive's numbers ----------------------------------------------------------------------------------
(
    KIND, KP, KI, KD, KR, SPAN, LIMIT, CONTROL_PERIOD, MAX_STEP, SPRING, RETURNS, SIGNAL_GAIN, START_POSITION,
    START_VELOCITY, COUNT, SLACK, FORGETS, DRIVE,
) = range(18)  # fmt: skip
HELD, LINEAR, FEEDBACK = 0.0, 1.0, 2.0  # KIND
SEARCH, MOVES = len(ROOT.scalars), len(MOTION.scalars)
APPLIED = 4  # place in the surroundings
ready = compiled.ready
SPEED_LIMIT = 1e9  # rad/s, beyond which a simulation has diverged

# ---- columns of the signals and of the result -------------------------------------------------------------
TIME, SIGNAL, SUPPLY, POSITION, DAMPING, GOAL, FIRM, SIGNALS = range(8)
OUT_POSITION, OUT_VELOCITY, OUT_DRIVE, OUT_CORRECTION, OUTS = range(5)

# ---- what a sampled controller remembers ------------------------------------------------------------------
LAST, BEFORE_LAST, LAST_REFERENCE, ERROR_SUM, LAST_ERROR, STARTED, BEHIND, MEMORY = range(8)


@kernel()
def limited(x: float, limit: float) -> float:
    """x within +-limit."""
    return min(max(x, -limit), limit)


@kernel()
def control(c: Any, m: Any, reference: float, position: float, dt: float) -> float:
    """One sample of the controller: its output in the drive's unit, within its limit.

    The velocity is the difference over ``SPAN`` samples (2: of the mean of two neighbours, as in EMPS).
    """
    error = reference - position
    if m[STARTED] == 0.0:
        # Before the first sample axis and reference moved at the velocity of the begin.
        m[LAST], m[BEFORE_LAST] = position - c[START_VELOCITY] * dt, position - 2.0 * c[START_VELOCITY] * dt
        m[LAST_REFERENCE], m[LAST_ERROR], m[STARTED] = reference - c[START_VELOCITY] * dt, error, 1.0
    if c[SPAN] == 2.0:
        velocity = 0.5 * (position - m[BEFORE_LAST]) / dt
    else:
        velocity = (position - m[LAST]) / dt
    reference_rate = (reference - m[LAST_REFERENCE]) / dt
    m[ERROR_SUM] += 0.5 * dt * (error + m[LAST_ERROR])
    out = c[KP] * error + c[KI] * m[ERROR_SUM] + c[KR] * reference_rate - c[KD] * velocity
    m[BEFORE_LAST], m[LAST] = m[LAST], position
    m[LAST_REFERENCE], m[LAST_ERROR] = reference, error
    return limited(c[SIGNAL_GAIN] * out, c[LIMIT])


@kernel()
def seen(n: Any, last: float, position: float) -> float:
    """Position behind the backlash: it stays until the gap is used up."""
    half = 0.5 * n[BACKLASH]
    return min(max(last, position - half), position + half)


@kernel()
def counted(c: Any, position: float) -> float:
    """The position in whole counts of the encoder; exact where it has none."""
    return c[COUNT] * math.floor(position / c[COUNT] + 0.5) if c[COUNT] > 0.0 else position


@kernel()
def beyond(c: Any, away: float) -> float:
    """How far the axis lies from where it was seen, beyond what the encoder leaves open."""
    return away - limited(away, c[SLACK])


@kernel()
def command(c: Any, m: Any, signals: Any, k: int, y: float, dt: float) -> float:
    """What the drive is told at a sample: the recorded signal, or the controller's answer to it."""
    if c[KIND] == FEEDBACK:
        return control(c, m, signals[k, SIGNAL], counted(c, y), dt)
    return c[SIGNAL_GAIN] * signals[k, SIGNAL]


@kernel()
def slope(c: Any, signals: Any, k: int, dt: float) -> float:
    """Slope of a recorded signal that runs linearly from sample to sample; 0 for one that is held."""
    if c[KIND] != LINEAR:
        return 0.0
    return c[SIGNAL_GAIN] * (signals[k + 1, SIGNAL] - signals[k, SIGNAL]) / dt


@kernel(inline=True)
def advance(c: Plant, drive: float, rate: float, h: float) -> None:
    """Move the axis on by h under the torque of the drive at standstill, `drive` at the begin and rising at `rate`."""
    n, q, u = c.numbers, c.motion[0], c.surroundings
    u[0], u[1], u[APPLIED] = q, load_of(n, q, c.motion[1], drive), drive + n[PUSH]
    factor = share(n, q) * (u[1] if n[SCALED_BY_LOAD] != 0.0 else 1.0)
    two_stages(c, n, c.motion, c.first, c.second, u[APPLIED], rate, h, factor)


@kernel()
def follow(
    numbers: Any, step: int, holding: int, parameters: Any, surroundings: Any, start: Any, c: Any, signals: Any,
    disturbance: Any, out: Any,
) -> int:  # fmt: skip
    """Simulate over the record's times; returns how many rows of `out` were reached with finite numbers."""
    n = numbers
    states, trial, base = start.copy(), start.copy(), start.copy()
    searches, state, m = np.zeros((2, SEARCH)), np.zeros(MOVES), np.zeros(MEMORY)
    n[HOLDS] = 1.0 if holding != 0 else 0.0
    plant = Plant(
        step, holding, pointer(parameters, 0), pointer(surroundings, 0), pointer(states, 0), pointer(base, 0),
        pointer(trial, 0), start.size, pointer(numbers, 0), pointer(state, 0), pointer(searches, 0),
        pointer(searches, SEARCH),
    )  # fmt: skip
    ready(plant.first, n[INERTIA], ROUNDING, LEAST, 1.0 - n[HOLDS])
    ready(plant.second, n[INERTIA], ROUNDING, LEAST, 1.0 - n[HOLDS])
    state[0], state[1] = c[START_POSITION], c[START_VELOCITY]
    y = state[0]
    rows = signals.shape[0]
    loss = n[BACK_EMF]
    for k in range(rows):
        # Without supply the winding is open: no current flows, so nothing is lost to it.
        goal, firm = signals[k, GOAL], signals[k, FIRM] != 0.0
        # Behind a low-pass, the damper is what it remembers and a damper on the velocity that the step solves for.
        forgets = 1.0 if firm else c[FORGETS]
        damping, kept = forgets * signals[k, DAMPING], (1.0 - forgets) * signals[k, DAMPING] * m[BEHIND]
        if n[BACKLASH] > 0.0:
            # What is measured lies behind the play: its velocity is no goal of the step, and is damped a sample later.
            damping, kept = 0.0, signals[k, DAMPING] * m[BEHIND]
        n[BACK_EMF] = loss if signals[k, SUPPLY] != 0.0 else 0.0
        n[LOSS] = n[BACK_EMF] + damping
        out[k, OUT_POSITION], out[k, OUT_VELOCITY] = y, state[1]
        before = min(k, rows - 2)
        dt = signals[before + 1, TIME] - signals[before, TIME]
        acts = 1
        if c[KIND] == FEEDBACK and c[CONTROL_PERIOD] > 0.0:
            acts = max(1, int(dt / c[CONTROL_PERIOD] + 0.5))
        substeps = max(1, math.ceil(dt / acts / c[MAX_STEP] - 1e-9))
        h = dt / acts / substeps
        first = y if n[BACKLASH] > 0.0 else state[0]
        pulled = 0.0
        for act in range(acts):
            u = command(c, m, signals, k, y, dt / acts)
            push = 0.0 if firm else kept + c[SPRING] * beyond(c, signals[k, POSITION] - y)
            if act == 0:
                out[k, OUT_DRIVE], pulled = u, push
            if k == rows - 1:
                break
            rate = slope(c, signals, k, dt)
            gain = n[DRIVE_GAIN] * signals[k, SUPPLY]
            n[PUSH] = push + damping * goal + disturbance[k]
            for i in range(substeps):
                advance(plant, gain * (u + rate * h * i), gain * rate, h)
                y = seen(n, y, state[0])
        moved = (y if n[BACKLASH] > 0.0 else state[0]) - first if k < rows - 1 else goal * dt
        out[k, OUT_CORRECTION] = pulled + damping * (goal - moved / dt)
        m[BEHIND] += c[FORGETS] * (goal - moved / dt - m[BEHIND])
        if firm and k < rows - 1:
            state[0] += min(dt * c[RETURNS], 1.0) * beyond(c, signals[k + 1, POSITION] - state[0])
            y = seen(n, y, state[0])
        if not (math.isfinite(state[0]) and abs(state[1]) < SPEED_LIMIT):
            return k + 1
    # The arrays are used here so that they outlive their addresses.
    return rows if states.size + trial.size + base.size + searches.size + state.size >= 0 else 0


@kernel()
def respond(c: Any, signals: Any, out: Any) -> None:
    """What the controller makes of a recorded position, sample by sample."""
    m = np.zeros(MEMORY)
    for k in range(signals.shape[0]):
        before = min(k, signals.shape[0] - 2)
        dt = signals[before + 1, TIME] - signals[before, TIME]
        out[k] = command(c, m, signals, k, signals[k, POSITION], dt)
