"""Two times between which something rises through zero, and how they close in on that."""

from __future__ import annotations

from typing import NamedTuple

from stickslip.jit import kernel

TRUSTED = 10
"""Looks after which the middle is taken."""


class Bracket(NamedTuple):
    """Both ends and what stands there; an end that stays for the second time counts for less (Anderson and Björck)."""

    low: float
    high: float
    below: float
    """at the low end: at most 0"""
    above: float
    """at the high end"""
    excess: float
    """at the high end as it is, where `above` may count for less"""
    moved: float
    """+1: the high end came last, -1: the low one"""


@kernel(exact=False, inline=True)
def bracket(low: float, high: float, below: float, above: float) -> Bracket:
    """The ends before the first look."""
    return Bracket(low, high, min(below, 0.0), above, above, 0.0)


@kernel(exact=False, inline=True)
def where_next(b: Bracket, near: float, looks: int) -> float:
    """Where to look after so many looks, so that half of `near` should stand there: from above it is near enough."""
    t = b.high - (b.above - 0.5 * near) * (b.high - b.low) / (b.above - b.below)
    return t if b.low < t < b.high and looks <= TRUSTED else 0.5 * (b.low + b.high)


@kernel(exact=False, inline=True)
def narrowed(b: Bracket, t: float, f: float) -> Bracket:
    """The ends after a look at t, where f stands."""
    if f >= 0.0:
        return Bracket(b.low, t, b.below * less(f, b.above) if b.moved > 0.0 else b.below, f, f, 1.0)
    return Bracket(t, b.high, f, b.above * less(f, b.below) if b.moved < 0.0 else b.above, b.excess, -1.0)


@kernel(exact=False, inline=True)
def less(now: float, before: float) -> float:
    """What an end counts for that stays where the other one has come from `before` to `now`."""
    part = 1.0 - now / before
    return part if part > 0.0 else 0.5
