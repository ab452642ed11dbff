"""Filters of second-order sections, forwards and backwards, over one series after another."""

from __future__ import annotations

from typing import Any

from stickslip.jit import kernel


@kernel()
def zero_phase(sections: Any, start: Any, x: Any) -> None:
    """Filter ``x`` in place, forwards and backwards, each time from the steady state of its first value.

    ``sections`` (m, 6), an even number of them, and ``start`` (m, 2) as `scipy.signal.sosfilt` and ``sosfilt_zi`` lay
    them out; each section is a transposed direct form II.
    """
    n = x.size
    for way in range(2):
        first, onwards = (0, 1) if way == 0 else (n - 1, -1)
        begin = x[first]
        # Two sections at a time: one's next value waits for its last, the other's for another.
        for s in range(0, sections.shape[0], 2):
            b0, b1, b2 = sections[s, 0], sections[s, 1], sections[s, 2]
            a1, a2 = sections[s, 4], sections[s, 5]
            c0, c1, c2 = sections[s + 1, 0], sections[s + 1, 1], sections[s + 1, 2]
            d1, d2 = sections[s + 1, 4], sections[s + 1, 5]
            y0, y1 = begin * start[s, 0], begin * start[s, 1]
            z0, z1 = begin * start[s + 1, 0], begin * start[s + 1, 1]
            at = first
            for _ in range(n):
                value = x[at]
                middle = b0 * value + y0
                y0 = b1 * value - a1 * middle + y1
                y1 = b2 * value - a2 * middle
                out = c0 * middle + z0
                z0 = c1 * middle - d1 * out + z1
                z1 = c2 * middle - d2 * out
                x[at] = out
                at += onwards
