"""Segments of a record side by side, each an axis that an observer holds to the measured motion.

The step of `driven.step` in the loop of `driven.loop`, for a torque that is held and without what depends on the
position. All lanes iterate until the last has solved its stage; those that have keep their velocity. Nothing branches
on what differs between lanes, so that the compiler runs 4 or 8 of them at once (`docs/decisions/0015-lanes.md` says
what that takes). ``w`` holds the lanes, row after row of `LANES` numbers; ``n`` the numbers of axis and observer, and
``p`` the law's, which all share.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from stickslip.jit import pointer, select
from stickslip.simulation.recorded_input.simd_names import HOLDS, LANES, STATES, law, searched, withstood

GAMMA = 1.0 - math.sqrt(0.5)  # Alexander's coefficient
MOST = 200  # evaluations of a stage

# ---- entries of n ----------------------------------------------------------------------------------------------
(
    INERTIA, OFFSET, DRIVE_GAIN, BACK_EMF, LOAD_MOTOR, LOAD_EXTERNAL, SCALED, SPRING, FORGETS, RETURNS, SLACK,
    ROUNDING, NUMBERS,
) = range(13)  # fmt: skip
# ---- rows of the signals: torque's signal, position now and next, damping, velocity to follow, whether the damper is
# firm, torque from outside, whether the row is followed by another, and after how long -----------------------------
SIGNAL, SEEN, NEXT, DAMPING, GOAL, FIRM, DISTURBANCE, GOES_ON, PERIOD, SIGNALS = range(10)
# ---- rows of w behind the signals: the axis, the stage that is solved, and its iteration ---------------------------
(
    POSITION, VELOCITY, BEHIND, FIRST, PULLED, DAMPED, LOSS, TORQUE, LOAD, FACTOR, BEGIN, X, LAST, F_LAST, OTHER, PHASE,
    RISE, OTHER_RISE, STEP, STATE,
) = range(SIGNALS, SIGNALS + 20)  # fmt: skip
BASE = STATE + STATES
TRIAL = BASE + STATES
ROWS = TRIAL + STATES
GUESSED, LEADS_ON, SOLVED = 0.0, 1.0, 3.0  # PHASE, as in `stickslip.simulation.root`


# ---- a stage of backward Euler, solved by `stickslip.simulation.root` in all lanes -------------------------------


def start(w: Any, lane: int, n: Any, p: Any) -> None:
    """Begin a stage at the velocity guessed in ``X``; a contact that holds is solved at once."""
    w[PHASE * LANES + lane] = GUESSED
    if HOLDS:
        h = GAMMA * w[STEP * LANES + lane]
        impulse = n[INERTIA] * w[BEGIN * LANES + lane] + h * (w[TORQUE * LANES + lane] - n[OFFSET])
        side = select(impulse > 0.0, 1.0, -1.0)
        held = h * w[FACTOR * LANES + lane] * withstood(w, lane, side, p)
        rests = abs(impulse) <= held
        guess = w[X * LANES + lane]
        guess = select(guess * side <= 0.0, (impulse - side * held) / n[INERTIA], guess)
        # The unbalance jumps at rest: on this side of it lies the root.
        w[LAST * LANES + lane] = 0.0
        w[F_LAST * LANES + lane] = side * held - impulse
        w[OTHER * LANES + lane] = 0.0
        w[X * LANES + lane] = select(rests, 0.0, guess)
        w[PHASE * LANES + lane] = select(rests, SOLVED, LEADS_ON)


def look(w: Any, lane: int, n: Any, p: Any) -> bool:
    """The unbalance at ``X``, and the next velocity; whether that is worth another look."""
    h = GAMMA * w[STEP * LANES + lane]
    x = w[X * LANES + lane]
    torque = w[FACTOR * LANES + lane] * law(w, lane, x, h, p)
    applied = w[TORQUE * LANES + lane] - w[LOSS * LANES + lane] * x - n[OFFSET] - torque
    f = n[INERTIA] * (x - w[BEGIN * LANES + lane]) - h * applied
    return searched(w, lane, f, n[INERTIA] * n[ROUNDING], n[ROUNDING]) > 0.0


def solve(w: Any, n: Any, p: Any, count: int) -> None:
    """Solve a stage in all lanes."""
    for lane in range(count):
        start(w, lane, n, p)
    for _ in range(MOST):
        left = 0
        for lane in range(count):
            left += look(w, lane, n, p)
        if left == 0:
            break


# ---- a step ------------------------------------------------------------------------------------------------------


def first_stage(w: Any, lane: int, n: Any) -> None:
    """Lay out the first stage: the load where the step begins, and the velocity there as a guess."""
    v = w[VELOCITY * LANES + lane]
    drive = n[DRIVE_GAIN] * w[SIGNAL * LANES + lane]
    load = 1.0 + abs(n[LOAD_MOTOR] * (drive - n[BACK_EMF] * v) + n[LOAD_EXTERNAL] * n[OFFSET])
    w[LOAD * LANES + lane] = load
    w[FACTOR * LANES + lane] = select(n[SCALED] > 0.0, load, 1.0)
    w[BEGIN * LANES + lane] = v
    w[X * LANES + lane] = v
    take_other_rise(w, lane)
    for i in range(STATES):
        w[(BASE + i) * LANES + lane] = w[(STATE + i) * LANES + lane]


def second_stage(w: Any, lane: int, p: Any) -> None:
    """The second starts from the begin, moved on for the rest of the step with the slopes of the first."""
    middle = w[X * LANES + lane]
    begin = w[BEGIN * LANES + lane]
    rest = (1.0 - GAMMA) * w[STEP * LANES + lane]
    for i in range(STATES):
        w[(BASE + i) * LANES + lane] = w[(STATE + i) * LANES + lane]
    law(w, lane, middle, rest, p)
    for i in range(STATES):
        w[(BASE + i) * LANES + lane] = w[(TRIAL + i) * LANES + lane]
    w[POSITION * LANES + lane] += rest * middle
    w[BEGIN * LANES + lane] = begin + (1.0 - GAMMA) / GAMMA * (middle - begin)
    w[X * LANES + lane] = middle + (middle - begin)
    take_other_rise(w, lane)


def take_other_rise(w: Any, lane: int) -> None:
    """How the unbalance rises with the velocity is remembered for each stage."""
    rise = w[RISE * LANES + lane]
    w[RISE * LANES + lane] = w[OTHER_RISE * LANES + lane]
    w[OTHER_RISE * LANES + lane] = rise


def accept(w: Any, lane: int) -> None:
    """The state that the second stage reached."""
    end = w[X * LANES + lane]
    w[POSITION * LANES + lane] += GAMMA * w[STEP * LANES + lane] * end
    w[VELOCITY * LANES + lane] = end
    for i in range(STATES):
        w[(STATE + i) * LANES + lane] = w[(TRIAL + i) * LANES + lane]


# ---- a row of the record -------------------------------------------------------------------------------------------


def beyond(away: float, slack: float) -> float:
    """How far the axis lies from where it was seen, beyond what the encoder leaves open."""
    inside = select(away > slack, slack, away)
    return away - select(inside < -slack, -slack, inside)


def pull(w: Any, lane: int, n: Any, substeps: int) -> None:
    """What the observer adds over this row."""
    firm = w[FIRM * LANES + lane] > 0.0
    forgets = select(firm, 1.0, n[FORGETS])
    damping = forgets * w[DAMPING * LANES + lane]
    kept = (1.0 - forgets) * w[DAMPING * LANES + lane] * w[BEHIND * LANES + lane]
    away = w[SEEN * LANES + lane] - w[POSITION * LANES + lane]
    push = select(firm, 0.0, kept + n[SPRING] * beyond(away, n[SLACK]))
    w[PULLED * LANES + lane] = push
    w[DAMPED * LANES + lane] = damping
    w[LOSS * LANES + lane] = n[BACK_EMF] + damping
    drive = n[DRIVE_GAIN] * w[SIGNAL * LANES + lane]
    w[TORQUE * LANES + lane] = drive + push + damping * w[GOAL * LANES + lane] + w[DISTURBANCE * LANES + lane]
    w[FIRST * LANES + lane] = w[POSITION * LANES + lane]
    w[STEP * LANES + lane] = w[PERIOD * LANES + lane] / substeps


def look_back(w: Any, lane: int, n: Any) -> None:
    """What it added in the mean, and where it leads the position."""
    moved = (w[POSITION * LANES + lane] - w[FIRST * LANES + lane]) / w[PERIOD * LANES + lane]
    lacked = w[GOES_ON * LANES + lane] * (w[GOAL * LANES + lane] - moved)
    w[PULLED * LANES + lane] += w[DAMPED * LANES + lane] * lacked
    w[BEHIND * LANES + lane] += n[FORGETS] * (lacked - w[BEHIND * LANES + lane])
    away = beyond(w[NEXT * LANES + lane] - w[POSITION * LANES + lane], n[SLACK])
    share = n[RETURNS] * w[PERIOD * LANES + lane]
    share = select(share < 1.0, share, 1.0)
    w[POSITION * LANES + lane] += select(w[FIRM * LANES + lane] > 0.0, share * away, 0.0)


def follow_lanes(
    n: Any, p: Any, states: Any, speeds: Any, signals: Any, substeps: int, count: int, out: Any
) -> None:
    """Follow all segments; ``signals`` (rows, SIGNALS, LANES), ``out`` (rows, LANES) receives the corrections.

    ``states`` are the law's at rest. A segment begins where it was seen, at its velocity in ``speeds``.
    """
    room = aligned(ROWS * LANES)
    w = pointer(room, 0)
    for lane in range(count):
        w[POSITION * LANES + lane] = signals[0, SEEN, lane]
        w[VELOCITY * LANES + lane] = speeds[lane]
        w[RISE * LANES + lane] = 1.0 / n[INERTIA]
        w[OTHER_RISE * LANES + lane] = 1.0 / n[INERTIA]
        for i in range(STATES):
            w[(STATE + i) * LANES + lane] = states[i]
    for t in range(signals.shape[0]):
        for i in range(SIGNALS):
            for lane in range(count):
                w[i * LANES + lane] = signals[t, i, lane]
        for lane in range(count):
            pull(w, lane, n, substeps)
        for _ in range(substeps):
            for lane in range(count):
                first_stage(w, lane, n)
            solve(w, n, p, count)
            for lane in range(count):
                second_stage(w, lane, p)
            solve(w, n, p, count)
            for lane in range(count):
                accept(w, lane)
        for lane in range(count):
            look_back(w, lane, n)
        for lane in range(count):
            out[t, lane] = w[PULLED * LANES + lane]
    room[0] = 0.0  # So long it is needed: an array is freed after its last use, whatever points into it.


def aligned(size: int) -> Any:
    """Zeros that begin on a cache line, since vectors across two of them cost twice."""
    room = np.zeros(size + 8)
    first = (64 - room.ctypes.data % 64) % 64 // 8
    return room[first : first + size]
