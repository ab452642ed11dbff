"""One window of the meter: integrals, extremes, and what is counted, where five nodes show all of the motion or all but
its ringing."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import kernel
from stickslip.simulation._meter import MAX_WINDOW, Sums, Turns, add, add_high_pass, high_pass, reached, sums
from stickslip.simulation._nodes import COMPENSATING, ERROR, ERROR_RATE, FRICTION, MOTOR, SPEED, extremes
from stickslip.simulation.exact.flow import UNMOVED, Linear, Matrix, flow, free_motion
from stickslip.simulation.exact.ringing import Ringing, at_nodes, high_passed, overlap, quartic
from stickslip.simulation.exact.scan import (
    NO_FREE,
    Farthest,
    Free,
    Look,
    Slack,
    Span,
    calm,
    count_events,
    creeps,
    events_seen,
    farther,
    passes,
    peak_of,
    peaks_seen,
    reach,
    slack_of,
    turns_while_creeping,
)

TINY = 1e-300
SMALL = 1e-6
"""Part of a peak so far; ringing below it is not looked for in that peak."""
A_RADIAN = 5.0
"""Steps in which a radian of ringing is looked through that makes a peak; fewer where it is a part of one."""
FINE = 0.5e-3
"""Step in which reversals, standstills and settling are looked for, s."""
STEPS = 12
"""Fewest steps of a window that is looked through."""


NONE = (0.0, 0.0, 0.0, 0.0, 0.0)
NO_RINGING = Ringing(0.0, 1.0, 0.0, 0.0, 0.0, 0.0, NONE, NONE, 0.0, 0.0, 0.0)


class Shares(NamedTuple):
    """What the free motion adds to the torques of motor, friction and compensator: by its position, N·m/rad, and by its
    velocity, N·m·s/rad."""

    motor_p: float
    motor_v: float
    friction_p: float
    friction_v: float
    compensating_p: float
    compensating_v: float


class Rings(NamedTuple):
    """What rings in a window: the axis, its flow over a quarter of the window, the free motion, and what that adds."""

    axis: Linear
    quarter: Matrix
    motion: Ringing
    share: Shares


class Swings(NamedTuple):
    """What ringing adds to error, velocity and motor torque at most."""

    error: float
    speed: float
    motor: float


@kernel(exact=False, inline=True)
def window(acc: Any, turns: Turns, nodes: Any, span: Span) -> None:
    """Add a window whose nodes show all of the motion."""
    t, width = span
    low, high = extremes(nodes, 0.25 * width)
    fine = acc.window <= MAX_WINDOW
    slack = slack_of(nodes)
    second = add(acc, t, width, sums(nodes), nodes[ERROR + 4])
    reached(acc, second, low, high, abs(nodes[SPEED + 4]), abs(nodes[MOTOR + 4]))
    if reach(nodes, SPEED, slack.speed) > acc.v_max:
        acc.v_max = max(acc.v_max, peak_of(nodes, SPEED, width, STEPS))
    if reach(nodes, MOTOR, slack.motor) > acc.tm_max:
        acc.tm_max = max(acc.tm_max, peak_of(nodes, MOTOR, width, STEPS))
    if not fine:
        return
    if width <= MAX_WINDOW:
        high_pass(acc, width, nodes, second)
    else:
        total, acc.low_pass = high_passed(quartic(nodes, SPEED), NO_RINGING, width, False, acc.low_pass)
        add_high_pass(acc, total, second)
    if calm(acc, nodes, 0, 4, 0.0, 0.0, slack):
        passes(acc, turns, nodes, span, 0, 4, nodes[SPEED], nodes[SPEED + 4])
    elif creeps(acc, nodes, NO_FREE, slack):
        steps = math.ceil(max(STEPS, width / FINE))
        turns_while_creeping(acc, nodes, span, Look(0.0, 1.0, steps, UNMOVED, NO_FREE))
    else:
        steps = math.ceil(max(STEPS, width / FINE) / 4.0)
        for k in range(4):
            if calm(acc, nodes, k, 1, 0.0, 0.0, slack):
                passes(acc, turns, nodes, span, k, 1, nodes[SPEED + k], nodes[SPEED + k + 1])
            else:
                look = Look(0.25 * k, 0.25, steps, UNMOVED, NO_FREE)
                count_events(acc, turns, nodes, span, look, slack, second)


@kernel(exact=False, inline=True)
def ringing_window(acc: Any, turns: Turns, nodes: Any, span: Span, rings: Rings) -> None:
    """Add a window whose nodes show all but the ringing."""
    ring, width = rings.motion, span.width
    fine = acc.window <= MAX_WINDOW
    events = False
    slack = slack_of(nodes)
    if fine:
        energy = ring.square * ring.p0 * ring.p0 + ring.q0 * ring.q0
        events = not calm(acc, nodes, 0, 4, math.sqrt(energy / ring.square), math.sqrt(energy) / width, slack)
    second = add(
        acc, span.begin, width, with_ringing(nodes, ring, rings.share, width), nodes[ERROR + 4] - ring.p1
    )
    look_through(acc, turns, nodes, span, rings, slack, events, second)
    if fine:
        passed, acc.low_pass = high_passed(quartic(nodes, SPEED), ring, width, True, acc.low_pass)
        add_high_pass(acc, passed, second)
        if not events:
            first, last = nodes[SPEED] + ring.q0 / width, nodes[SPEED + 4] + ring.q1 / width
            passes(acc, turns, nodes, span, 0, 4, first, last)


@kernel(exact=False, inline=True)
def look_through(
    acc: Any, turns: Turns, nodes: Any, span: Span, rings: Rings, slack: Slack, events: bool, second: bool
) -> None:  # fmt: skip
    """Note the extremes of a window that rings: what is looked through is each quarter whose bounds lie beyond those so
    far, or a short window as a whole.

    The end comes first: where a signal grows, it leaves the quarters before it nothing.
    """
    lin, m, ring, share = rings
    width = span.width
    v1 = ring.q1 / width
    last = nodes[ERROR + 4] - ring.p1
    motor = nodes[MOTOR + 4] + share.motor_p * ring.p1 + share.motor_v * v1
    reached(acc, second, last, last, abs(nodes[SPEED + 4] + v1), abs(motor))
    stiff = math.sqrt(lin.square)
    p = ring.p0
    v = ring.q0 / width
    parts = 1 if width * stiff * A_RADIAN <= 2.0 * STEPS else 4
    if parts > 1 and not events:
        shows, _ = shown(acc, nodes, 0, 4, slack, swings(stiff * p, v, stiff, share), False, second)
        if shows < 0.0:
            return
    for k in range(parts):
        sway = math.sqrt(lin.square * p * p + v * v)
        quiet = parts > 1 and events and calm(acc, nodes, k, 1, sway / stiff, sway, slack)
        here = events and not quiet
        shows, may = shown(acc, nodes, k, 4 // parts, slack, swings(stiff * p, v, stiff, share), here, second)
        if shows >= 0.0:
            long = width / parts
            count = max(STEPS / parts, long / FINE if here else 0.0)
            if shows > SMALL:
                # A cubic between two steps misses a crest by the fourth power of their length.
                count = max(count, long * stiff * A_RADIAN * math.sqrt(math.sqrt(min(shows, 1.0))))
            steps = math.ceil(count)
            free = Free(p, v, 2.0 * lin.decay, lin.square)
            look = Look(k / parts, 1.0 / parts, steps, flow(lin, long / steps), free)
            motor_shares = (share.motor_p, share.motor_v)
            peaks_seen(acc, nodes, width, look, motor_shares, may, second)
            if may.events:
                events_seen(acc, turns, nodes, span, look, slack, second)
        if parts > 1:
            before = nodes[SPEED + k] + v
            p, v = free_motion(m, p, v)
            if quiet:
                passes(acc, turns, nodes, span, k, 1, before, nodes[SPEED + k + 1] + v)


@kernel(exact=False, inline=True)
def swings(w: float, v: float, stiff: float, share: Shares) -> Swings:
    """What ringing adds to error, velocity and motor torque from here on at most, as its energy falls."""
    sway = math.sqrt(w * w + v * v)
    swing = sway / stiff
    return Swings(swing, sway, abs(share.motor_p) * swing + abs(share.motor_v) * sway)


@kernel(exact=False, inline=True)
def shown(
    acc: Any, nodes: Any, k: int, quarters: int, slack: Slack, rings: Swings, events: bool, second: bool
) -> tuple[float, Farthest]:  # fmt: skip
    """The greatest part that ringing has in a peak that some quarters of a window, from k on, may hold, -1 where they
    hold none; and which peaks they may hold."""
    swing, sway, pull = rings
    low = nodes[ERROR + k]
    high = low
    speed = abs(nodes[SPEED + k])
    motor = abs(nodes[MOTOR + k])
    for i in range(k + 1, k + quarters + 1):
        low = min(low, nodes[ERROR + i])
        high = max(high, nodes[ERROR + i])
        speed = max(speed, abs(nodes[SPEED + i]))
        motor = max(motor, abs(nodes[MOTOR + i]))
    shows = 0.0 if events else -1.0
    may = Farthest(
        farther(acc, second, low - slack.error - swing, high + slack.error + swing),
        speed + slack.speed + sway > acc.v_max,
        motor + slack.motor + pull > acc.tm_max,
        events,
    )
    if may.error:
        shows = max(shows, swing / (acc.e_max + TINY))
    if may.speed or events:
        shows = max(shows, sway / (acc.v_max + TINY))
    if may.motor:
        shows = max(shows, pull / (acc.tm_max + TINY))
    return shows, may


@kernel(exact=False, inline=True)
def with_ringing(nodes: Any, ring: Ringing, share: Shares, width: float) -> Sums:
    """The sums of a window, those of its nodes and of the ringing."""
    s = sums(nodes)
    of_p = at_nodes(ring.p_moments)
    of_q = at_nodes(ring.q_moments)
    inverse = 1.0 / width
    mp = share.motor_p
    mq = share.motor_v * inverse
    fp = share.friction_p
    fq = share.friction_v * inverse
    hp = share.compensating_p
    hq = share.compensating_v * inverse
    v_p = overlap(nodes, SPEED, of_p)
    v_q = overlap(nodes, SPEED, of_q)
    m_p = overlap(nodes, MOTOR, of_p)
    m_q = overlap(nodes, MOTOR, of_q)
    f_p = overlap(nodes, FRICTION, of_p)
    f_q = overlap(nodes, FRICTION, of_q)
    h_p = overlap(nodes, COMPENSATING, of_p)
    h_q = overlap(nodes, COMPENSATING, of_q)
    rp = fp - hp
    rq = fq - hq
    ev2 = inverse * (ring.qq * inverse - 2.0 * overlap(nodes, ERROR_RATE, of_q))
    tm2 = 2.0 * (mp * m_p + mq * m_q) + mean_square(ring, mp, mq)
    df2 = 2.0 * (rp * (f_p - h_p) + rq * (f_q - h_q)) + mean_square(ring, rp, rq)
    # A torque times the velocity: both have a part at the nodes and one that rings.
    work = inverse * (m_q + mp * ring.pq + mq * ring.qq) + mp * v_p + mq * v_q
    loss = inverse * (f_q + fp * ring.pq + fq * ring.qq) + fp * v_p + fq * v_q
    compensation = inverse * (h_q + hp * ring.pq + hq * ring.qq) + hp * v_p + hq * v_q
    return Sums(
        s.e - 90.0 * ring.p_moments[0],
        s.e2 + 90.0 * (ring.pp - 2.0 * overlap(nodes, ERROR, of_p)),
        s.ev2 + 90.0 * ev2,
        s.tm2 + 90.0 * tm2,
        s.df2 + 90.0 * df2,
        s.work + 90.0 * work,
        s.loss + 90.0 * loss,
        s.compensation + 90.0 * compensation,
    )


@kernel(exact=False, inline=True)
def mean_square(ring: Ringing, p: float, q: float) -> float:
    """Integral of the square of a sum of p and q."""
    return p * p * ring.pp + 2.0 * p * q * ring.pq + q * q * ring.qq
