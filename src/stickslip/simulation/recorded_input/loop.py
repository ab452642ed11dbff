"""The loop over a record's samples: what drives the axis, and what is kept of its motion."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import kernel, pointer, record_at
from stickslip.simulation.recorded_input.contact import load_of, share
from stickslip.simulation.recorded_input.layout import (
    DRIVE,
    MEMORY,
    MEMORY_SIZE,
    Laid,
    Run,
    moved_at,
    run_of,
    sample_at,
)
from stickslip.simulation.recorded_input.step import LEAST, ROUNDING, two_stages
from stickslip.simulation.root import compiled

HELD, LINEAR, FEEDBACK = 0.0, 1.0, 2.0
"""Kinds of drive."""
ready = compiled.ready
SPEED_LIMIT = 1e9  # rad/s, beyond which a simulation has diverged


@kernel()
def limited(x: float, limit: float) -> float:
    """x within +-limit."""
    return min(max(x, -limit), limit)


@kernel()
def cascaded(c: Any, m: Any, error: float, dt: float) -> float:
    """Output of the velocity PI at this error of the velocity: `stickslip.control.laws.cascade` with its conditional
    integration."""
    growth = dt * error
    out = c.kvp * error + c.kvi * (m.integral + growth)
    if not (abs(c.signal_gain * out) > c.limit and out * growth > 0.0):
        m.integral += growth
    return out


@kernel()
def control(c: Any, m: Any, reference: float, position: float, dt: float) -> float:
    """One sample of the controller: its output in the drive's unit, within its limit.

    The velocity is the difference over ``span`` samples (2: of the mean of two neighbours, as in EMPS).
    """
    error = reference - position
    if m.started == 0.0:
        # Before the first sample axis and reference moved at the velocity of the begin.
        m.last, m.before_last = position - c.start_velocity * dt, position - 2.0 * c.start_velocity * dt
        m.last_reference, m.last_error, m.started = reference - c.start_velocity * dt, error, 1.0
        m.filtered = c.start_velocity
    if c.span == 2.0:
        velocity = 0.5 * (position - m.before_last) / dt
    else:
        velocity = (position - m.last) / dt
    if c.corner > 0.0:
        velocity += math.exp(-c.corner * dt) * (m.filtered - velocity)
        m.filtered = velocity
    reference_rate = (reference - m.last_reference) / dt
    if c.kv > 0.0:
        out = cascaded(c, m, c.kv * error + c.feed * reference_rate - velocity, dt)
    else:
        m.error_sum += 0.5 * dt * (error + m.last_error)
        out = c.kp * error + c.ki * m.error_sum + c.kr * reference_rate - c.kd * velocity
    m.before_last, m.last = m.last, position
    m.last_reference, m.last_error = reference, error
    return limited(c.signal_gain * out, c.limit)


@kernel()
def seen(axis: Any, last: float, position: float) -> float:
    """Position behind the backlash: it stays until the gap is used up."""
    half = 0.5 * axis.backlash
    return min(max(last, position - half), position + half)


@kernel()
def counted(c: Any, position: float) -> float:
    """The position in whole counts of the encoder; exact where it has none."""
    return c.count * math.floor(position / c.count + 0.5) if c.count > 0.0 else position


@kernel()
def beyond(c: Any, away: float) -> float:
    """How far the axis lies from where it was seen, beyond what the encoder leaves open."""
    return away - limited(away, c.slack)


@kernel()
def command(c: Any, m: Any, signal: float, y: float, dt: float) -> float:
    """What the drive is told at a sample: the recorded signal, or the controller's answer to it."""
    if c.kind == FEEDBACK:
        return control(c, m, signal, counted(c, y), dt)
    return c.signal_gain * signal


@kernel()
def slope(run: Run, k: int, dt: float) -> float:
    """Slope of a recorded signal that runs linearly from sample to sample; 0 for one that is held."""
    c = run.drive
    if c.kind != LINEAR:
        return 0.0
    return c.signal_gain * (sample_at(run.signals, k + 1).signal - sample_at(run.signals, k).signal) / dt


@kernel(inline=True)
def advance(run: Run, drive: float, rate: float, h: float) -> None:
    """Move the axis on by h under the torque of the drive at standstill, `drive` at the begin and rising at `rate`."""
    plant, axis, around = run.plant, run.axis, run.around
    n, q = plant.numbers, run.moving.position
    around.position, around.load = q, load_of(n, q, run.moving.velocity, drive)
    around.applied = drive + axis.push
    factor = share(n, q) * (around.load if axis.scaled_by_load != 0.0 else 1.0)
    two_stages(plant, n, plant.motion, plant.first, plant.second, around.applied, rate, h, factor)


@kernel()
def between(run: Run, k: int, y: float, dt: float, kept: float, damping: float, ends: bool) -> float:
    """Move the axis from a sample to the next one unless the record `ends`; returns its position behind the backlash.

    `kept` is the damper's torque from the sample before.
    """
    axis, c, here, moved = run.axis, run.drive, sample_at(run.signals, k), moved_at(run.out, k)
    acts = 1
    if c.kind == FEEDBACK and c.control_period > 0.0:
        acts = max(1, int(dt / c.control_period + 0.5))
    substeps = max(1, math.ceil(dt / acts / c.max_step - 1e-9))
    h = dt / acts / substeps
    for act in range(acts):
        u = command(c, run.memory, here.signal, y, dt / acts)
        push = 0.0 if here.firm != 0.0 else kept + c.spring * beyond(c, here.position - y)
        if act == 0:
            moved.drive, moved.correction = u, push
        if ends:
            break
        rate = slope(run, k, dt)
        gain = axis.drive_gain * here.supply
        axis.push = push + damping * here.goal + run.disturbance[k]
        for i in range(substeps):
            advance(run, gain * (u + rate * h * i), gain * rate, h)
            y = seen(axis, y, run.moving.position)
    return y


@kernel()
def follow(laid: Laid) -> int:
    """Simulate over the record's times; returns how many rows of ``out`` were reached with finite numbers."""
    run = run_of(laid)
    axis, c, m, moving = run.axis, run.drive, run.memory, run.moving
    axis.holds = 1.0 if laid.holding != 0 else 0.0
    ready(run.plant.first, axis.inertia, ROUNDING, LEAST, 1.0 - axis.holds)
    ready(run.plant.second, axis.inertia, ROUNDING, LEAST, 1.0 - axis.holds)
    moving.position, moving.velocity = c.start_position, c.start_velocity
    y = moving.position
    rows = laid.signals.shape[0]
    loss = axis.back_emf
    for k in range(rows):
        here, moved = sample_at(run.signals, k), moved_at(run.out, k)
        # Without supply the winding is open: no current flows, so nothing is lost to it.
        goal, firm = here.goal, here.firm != 0.0
        # Behind a low-pass, the damper is what it remembers and a damper on the velocity that the step solves for.
        forgets = 1.0 if firm else c.forgets
        damping, kept = forgets * here.damping, (1.0 - forgets) * here.damping * m.behind
        if axis.backlash > 0.0:
            # What is measured lies behind the play: its velocity is no goal of the step, and is damped a sample later.
            damping, kept = 0.0, here.damping * m.behind
        axis.back_emf = loss if here.supply != 0.0 else 0.0
        axis.loss = axis.back_emf + damping
        moved.position, moved.velocity = y, moving.velocity
        before = min(k, rows - 2)
        dt = sample_at(run.signals, before + 1).time - sample_at(run.signals, before).time
        first = y if axis.backlash > 0.0 else moving.position
        y = between(run, k, y, dt, kept, damping, k == rows - 1)
        way = (y if axis.backlash > 0.0 else moving.position) - first if k < rows - 1 else goal * dt
        moved.correction += damping * (goal - way / dt)
        m.behind += c.forgets * (goal - way / dt - m.behind)
        if firm and k < rows - 1:
            seen_next = sample_at(run.signals, k + 1).position
            moving.position += min(dt * c.returns, 1.0) * beyond(c, seen_next - moving.position)
            y = seen(axis, y, moving.position)
        if not (math.isfinite(moving.position) and abs(moving.velocity) < SPEED_LIMIT):
            return k + 1
    return rows


@kernel()
def respond(drive: Any, signals: Any, out: Any) -> None:
    """What the controller makes of a recorded position, sample by sample."""
    c, memory, record = record_at(pointer(drive, 0), DRIVE), np.zeros(MEMORY_SIZE), pointer(signals, 0)
    m = record_at(pointer(memory, 0), MEMORY)
    for k in range(out.size):
        before = min(k, out.size - 2)
        dt = sample_at(record, before + 1).time - sample_at(record, before).time
        out[k] = command(c, m, sample_at(record, k).signal, sample_at(record, k).position, dt)
    memory[0] = 0.0  # So long it is needed: an array is freed after its last use, whatever points into it.
