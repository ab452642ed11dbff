"""How a force that grows along a polynomial acts on a linear system: tables over the nodes of a step.

A step has nodes at eighths of its length, tau = i / 8. The rate g of the slipping force is the polynomial through its
values there, and the force its integral. Nodes of a step that is twice as long are nodes of its halves, so that the
flow over it follows from theirs.
"""

from __future__ import annotations

import functools
import math
from fractions import Fraction
from typing import Any

import numpy as np

from stickslip.jit import WIDTH

Array = np.ndarray[Any, np.dtype[np.float64]]

PARTS = 8
"""Parts of a step."""
NODES = PARTS + 1
TERMS = 17
"""Of a flow's series: for omega h = 1 what is left out is below 1e-14."""

TAU = 0
"""Places of the tables, each of columns of `WIDTH` numbers: powers of tau at the nodes behind the start, of the
velocity and of the angle in turn."""
DRIVEN = TAU + 2 * (TERMS + 1)
"""By node j and term m, for the velocity and the angle in turn: what g = 1 at that node alone makes there."""
ENDS = DRIVEN + 2 * NODES * TERMS
"""By node j: the same at the end of the step, by terms."""
INTEGRAL = ENDS + 2 * NODES
"""By node j: its integral up to the nodes behind the start, over the length of the step."""
LEFT, RIGHT = INTEGRAL + NODES, INTEGRAL + 2 * NODES
"""By node j: its polynomial at the nodes of either half."""
POWERS = INTEGRAL + 3 * NODES
"""By node j: the polynomial's coefficients, in 2 tau - 1."""
COLUMNS = POWERS + NODES


def lagrange(j: int) -> list[Fraction]:
    """Coefficients, in tau, of the polynomial that is 1 at node j and 0 at the others."""
    out = [Fraction(1)]
    for i in range(NODES):
        if i != j:
            at, scale = Fraction(i, PARTS), Fraction(PARTS, j - i)
            out = [
                scale * (a - at * b) for a, b in zip([Fraction(0), *out], [*out, Fraction(0)], strict=True)
            ]
    return out


def integrals(times: int, tau: list[Fraction]) -> Array:
    """By tau and node: the integral of its polynomial from 0, so many times."""
    powers = [
        [
            _number(t ** (k + times) * Fraction(math.factorial(k), math.factorial(k + times)))
            for k in range(NODES)
        ]
        for t in tau
    ]
    # The coefficients alternate, and are up to 30,000 times their sum.
    return np.array(np.array(powers) @ _coefficients(), dtype=np.float64)


@functools.cache
def _coefficients() -> Any:
    """By power and node."""
    return np.array([[_number(c) for c in lagrange(j)] for j in range(NODES)]).T


def _number(x: Fraction) -> Any:
    return np.longdouble(x.numerator) / np.longdouble(x.denominator)


def centred(polynomial: list[Fraction]) -> list[float]:
    """Its coefficients in y = 2 tau - 1."""
    half = Fraction(1, 2)
    return [
        float(sum((c * half**k * math.comb(k, n) for k, c in enumerate(polynomial) if k >= n), Fraction(0)))
        for n in range(NODES)
    ]


@functools.cache
def tables() -> Array:
    """All tables, shape (COLUMNS * WIDTH,)."""
    nodes = [Fraction(i, PARTS) for i in range(NODES)]
    behind = nodes[1:]
    out = np.zeros((COLUMNS, WIDTH))
    for k in range(TERMS + 1):
        powers = [float(t**k) for t in behind]
        out[TAU + 2 * k, :PARTS], out[TAU + 2 * k + 1, PARTS:] = powers, powers
    driven = [integrals(m + 2, behind) for m in range(TERMS)]
    increased = integrals(1, behind)
    left, right = (integrals(0, [t / 2 + begin for t in nodes]) for begin in (Fraction(0), Fraction(1, 2)))
    for j in range(NODES):
        for m in range(TERMS):
            at = DRIVEN + 2 * (j * TERMS + m)
            out[at, :PARTS], out[at + 1, PARTS:] = driven[m][:, j], driven[m][:, j]
            out.reshape(-1)[(ENDS + 2 * j) * WIDTH + m] = driven[m][-1, j]
        out[INTEGRAL + j, :PARTS] = increased[:, j]
        out[LEFT + j, :NODES], out[RIGHT + j, :NODES] = left[:, j], right[:, j]
        out[POWERS + j, :NODES] = centred(lagrange(j))
    return np.ascontiguousarray(out.ravel())
