"""Segments of a record side by side, each an axis that an observer holds to the measured motion.

The step of `recorded_input.step` in the loop of `recorded_input.loop`, for a torque that is held and without what
depends on the position. All lanes iterate until the last has solved its stage; those that have keep their velocity.
Nothing branches on what differs between lanes, so that the compiler runs 4 or 8 of them at once
(`docs/decisions/0017-the-observer-in-stretches.md` says what that takes). ``w`` is a lane (`LANE`), ``n`` are the
numbers of axis and observer, ``p`` the law's, which all share.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from stickslip.jit import pointer, record_at, select
from stickslip.simulation.recorded_input.simd_names import HOLDS, LANES, STATES, law, searched, withstood

GAMMA = 1.0 - math.sqrt(0.5)  # Alexander's coefficient
MOST = 200  # evaluations of a stage


class Numbers(NamedTuple):
    """Numbers of axis and observer, which all lanes share, as `Mechanics` and `Drive` have them.

    A tuple's numbers are known to stay: those of a record might be among what the lanes write, and nothing vectorises.
    """

    inertia: float
    offset: float
    drive_gain: float
    back_emf: float
    load_motor: float
    load_external: float
    scaled: float
    """1 where the load scales the law's torque, else 0"""
    spring: float
    forgets: float
    returns: float
    slack: float
    rounding: float
    """To which part a velocity is solved"""


SIGNALS = ("signal", "seen", "next", "damping", "goal", "firm", "disturbance", "goes_on", "period")
"""Rows of the signals: the torque's, position now and next, damping, velocity to follow, whether the damper is firm,
torque from outside, whether the row is followed by another, and after how long."""
NAMES = (
    *SIGNALS,
    # The axis, what the observer adds, the stage that is solved, and its search (`stickslip.simulation.root`).
    "position", "velocity", "behind", "first", "pulled", "damped", "loss", "torque", "load", "factor", "begin", "x",
    "last", "f_last", "other", "phase", "rise", "other_rise", "step",
)  # fmt: skip
STATE = len(NAMES)
"""From this row on lies the law's state, then where the stage begins, and where it was tried last."""
LANE = np.dtype(
    {"names": NAMES, "formats": [np.float64] * STATE, "offsets": [8 * LANES * i for i in range(STATE)]}
)
"""A lane as a record: its numbers lie `LANES` apart, those of its neighbours between them."""
SEEN = SIGNALS.index("seen")
BASE = STATE + STATES
TRIAL = BASE + STATES
ROWS = TRIAL + STATES
GUESSED, LEADS_ON, SOLVED = 0.0, 1.0, 3.0  # phase, as in `stickslip.simulation.root`


# ---- a stage of backward Euler, solved by `stickslip.simulation.root` in all lanes -------------------------------


def start(w: Any, n: Numbers, p: Any) -> None:
    """Begin a stage at the velocity guessed in ``x``; a contact that holds is solved at once."""
    w.phase = GUESSED
    if HOLDS:
        h = GAMMA * w.step
        impulse = n.inertia * w.begin + h * (w.torque - n.offset)
        side = select(impulse > 0.0, 1.0, -1.0)
        held = h * w.factor * withstood(w, side, p)
        rests = abs(impulse) <= held
        guess = w.x
        guess = select(guess * side <= 0.0, (impulse - side * held) / n.inertia, guess)
        # The unbalance jumps at rest: on this side of it lies the root.
        w.last = 0.0
        w.f_last = side * held - impulse
        w.other = 0.0
        w.x = select(rests, 0.0, guess)
        w.phase = select(rests, SOLVED, LEADS_ON)


def look(w: Any, n: Numbers, p: Any) -> bool:
    """The unbalance at ``x``, and the next velocity; whether that is worth another look."""
    h = GAMMA * w.step
    x = w.x
    torque = w.factor * law(w, x, h, p)
    applied = w.torque - w.loss * x - n.offset - torque
    f = n.inertia * (x - w.begin) - h * applied
    return searched(w, f, n.inertia * n.rounding, n.rounding) > 0.0


def solve(room: Any, n: Numbers, p: Any, count: int) -> None:
    """Solve a stage in all lanes."""
    for lane in range(count):
        start(record_at(pointer(room, lane), LANE), n, p)
    for _ in range(MOST):
        left = 0
        for lane in range(count):
            left += look(record_at(pointer(room, lane), LANE), n, p)
        if left == 0:
            break


# ---- a step ------------------------------------------------------------------------------------------------------


def first_stage(w: Any, n: Numbers) -> None:
    """Lay out the first stage: the load where the step begins, and the velocity there as a guess."""
    v = w.velocity
    drive = n.drive_gain * w.signal
    load = 1.0 + abs(n.load_motor * (drive - n.back_emf * v) + n.load_external * n.offset)
    w.load = load
    w.factor = select(n.scaled > 0.0, load, 1.0)
    w.begin = v
    w.x = v
    take_other_rise(w)
    take_states(w, STATE, BASE)


def second_stage(w: Any, p: Any) -> None:
    """The second starts from the begin, moved on for the rest of the step with the slopes of the first."""
    middle = w.x
    begin = w.begin
    rest = (1.0 - GAMMA) * w.step
    take_states(w, STATE, BASE)
    law(w, middle, rest, p)
    take_states(w, TRIAL, BASE)
    w.position += rest * middle
    w.begin = begin + (1.0 - GAMMA) / GAMMA * (middle - begin)
    w.x = middle + (middle - begin)
    take_other_rise(w)


def take_states(w: Any, source: int, target: int) -> None:
    """Copy the states of the law from rows to others."""
    z = pointer(w, 0)
    for i in range(STATES):
        z[(target + i) * LANES] = z[(source + i) * LANES]


def take_other_rise(w: Any) -> None:
    """How the unbalance rises with the velocity is remembered for each stage."""
    rise = w.rise
    w.rise = w.other_rise
    w.other_rise = rise


def accept(w: Any) -> None:
    """The state that the second stage reached."""
    end = w.x
    w.position += GAMMA * w.step * end
    w.velocity = end
    take_states(w, TRIAL, STATE)


# ---- a row of the record -------------------------------------------------------------------------------------------


def beyond(away: float, slack: float) -> float:
    """How far the axis lies from where it was seen, beyond what the encoder leaves open."""
    inside = select(away > slack, slack, away)
    return away - select(inside < -slack, -slack, inside)


def pull(w: Any, n: Numbers, substeps: int) -> None:
    """What the observer adds over this row."""
    firm = w.firm > 0.0
    forgets = select(firm, 1.0, n.forgets)
    damping = forgets * w.damping
    kept = (1.0 - forgets) * w.damping * w.behind
    away = w.seen - w.position
    push = select(firm, 0.0, kept + n.spring * beyond(away, n.slack))
    w.pulled = push
    w.damped = damping
    w.loss = n.back_emf + damping
    drive = n.drive_gain * w.signal
    w.torque = drive + push + damping * w.goal + w.disturbance
    w.first = w.position
    w.step = w.period / substeps


def look_back(w: Any, n: Numbers) -> None:
    """What it added in the mean, and where it leads the position."""
    moved = (w.position - w.first) / w.period
    lacked = w.goes_on * (w.goal - moved)
    w.pulled += w.damped * lacked
    w.behind += n.forgets * (lacked - w.behind)
    away = beyond(w.next - w.position, n.slack)
    share = n.returns * w.period
    share = select(share < 1.0, share, 1.0)
    w.position += select(w.firm > 0.0, share * away, 0.0)


def follow_lanes(
    n: Numbers, p: Any, states: Any, speeds: Any, signals: Any, substeps: int, count: int, out: Any
) -> None:
    """Follow all segments; ``signals`` (rows, SIGNALS, LANES), ``out`` (rows, LANES) receives the corrections.

    ``states`` are the law's at rest. A segment begins where it was seen, at its velocity in ``speeds``.
    """
    room = aligned(ROWS * LANES)
    all_of = pointer(room, 0)
    for lane in range(count):
        w = record_at(pointer(all_of, lane), LANE)
        w.position = signals[0, SEEN, lane]
        w.velocity = speeds[lane]
        w.rise = 1.0 / n.inertia
        w.other_rise = 1.0 / n.inertia
        for i in range(STATES):
            all_of[(STATE + i) * LANES + lane] = states[i]
    for t in range(signals.shape[0]):
        for i in range(signals.shape[1]):
            for lane in range(count):
                all_of[i * LANES + lane] = signals[t, i, lane]
        for lane in range(count):
            pull(record_at(pointer(all_of, lane), LANE), n, substeps)
        for _ in range(substeps):
            for lane in range(count):
                first_stage(record_at(pointer(all_of, lane), LANE), n)
            solve(all_of, n, p, count)
            for lane in range(count):
                second_stage(record_at(pointer(all_of, lane), LANE), p)
            solve(all_of, n, p, count)
            for lane in range(count):
                accept(record_at(pointer(all_of, lane), LANE))
        for lane in range(count):
            look_back(record_at(pointer(all_of, lane), LANE), n)
        for lane in range(count):
            out[t, lane] = record_at(pointer(all_of, lane), LANE).pulled
    room[0] = 0.0  # So long it is needed: an array is freed after its last use, whatever points into it.


def aligned(size: int) -> Any:
    """Zeros that begin on a cache line, since vectors across two of them cost twice."""
    room = np.zeros(size + 8)
    first = (64 - room.ctypes.data % 64) % 64 // 8
    return room[first : first + size]
