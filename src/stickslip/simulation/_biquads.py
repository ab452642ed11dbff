"""Filters of second-order sections, forwards and backwards, over one series after another."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel


@kernel()
def zero_phase(sections: Any, start: Any, x: Any) -> None:
    """Filter ``x`` in place, forwards and backwards, each time from the steady state of its first value.

    ``sections`` (m, 6) and ``start`` (m, 2) as `scipy.signal.sosfilt` and ``sosfilt_zi`` lay them out; each section is
    a transposed direct form II.
    """
    n = x.size
    for way in range(2):
        first, onwards = (0, 1) if way == 0 else (n - 1, -1)
        begin = x[first]
        for s in range(sections.shape[0]):
            b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
            a1, a2 = sections[s, 4], sections[s, 5]
            z0, z1 = begin * start[s, 0], begin * start[s, 1]
            at = first
            for _ in range(n):
                value = x[at]
                out = b0 * value + z0
                z0 = b1 * value - a1 * out + z1
                z1 = b2 * value - a2 * out
                x[at] = out
                at += onwards
