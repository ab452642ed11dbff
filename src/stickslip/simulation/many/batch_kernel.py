"""Many closed loops after each other in compiled code: what a batch adds to the kernel of the exact integrator."""

from __future__ import annotations

import math
from typing import Any

from stickslip.jit import call_value, kernel, pointer, record_at
from stickslip.simulation._meter import TURN_COUNT, close_standstill
from stickslip.simulation.exact.kernel import AT_NOW, AT_SIDES, solve
from stickslip.simulation.exact.state import NOW
from stickslip.simulation.metrics import limit_cycle

BISECTIONS = 200


@kernel()
def curve_at(address: int, rows: Any, v: float, out: Any) -> None:
    """The sliding curve of every case at one velocity."""
    for i in range(rows.shape[0]):
        out[i] = call_value(address, v, pointer(rows[i], 0))


@kernel()
def least_of(address: int, rows: Any, scales: Any, multiples: Any, out: Any) -> None:
    """The least value of every case's sliding curve on multiples of its velocity scale, in both directions."""
    for i in range(rows.shape[0]):
        least = math.inf
        for x in multiples:
            for sign in (1.0, -1.0):
                least = min(least, call_value(address, sign * (scales[i] * x), pointer(rows[i], 0)))
        out[i] = least


@kernel()
def layers(address: int, rows: Any, scales: Any, slopes: Any, viscous: Any, shares: Any, out: Any) -> None:
    """Velocity at which the steep slope of every case meets its sliding curve, rad/s (`exact.layer_of`)."""
    for i in range(rows.shape[0]):
        scale = scales[i] if scales[i] > 0.0 else 1.0
        low = 1e-9 * scale
        high = 1e4 * scale
        for _ in range(BISECTIONS):
            v = 0.5 * (low + high)
            if (slopes[i] - viscous[i]) * v - shares[i] * call_value(address, v, pointer(rows[i], 0)) > 0.0:
                high = v
            else:
                low = v
        out[i] = high


@kernel(exact=False)
def solve_all(
    parameters: Any, plans: Any, cells: Any, breaks: Any, starts: Any, scratch: Any, nothing: Any, nothing_1: Any,
    accs: Any, turns: Any, nodes: Any, cycles: Any, codes: Any, ends: Any, metered: bool,
) -> None:  # fmt: skip
    """Run every case from its start; writes how and where it ended, and what the meter and its turns say.

    ``starts`` (n, ...) holds sides and elements; ``ends`` (n, 3) receives time, position and velocity.
    """
    for i in range(codes.size):
        scratch[:] = 0.0
        for j in range(starts.shape[1]):
            scratch[AT_SIDES + j] = starts[i, j]
        codes[i] = solve(
            parameters[i], plans[i], cells, breaks, nothing_1, scratch, nothing, nothing, accs[i], turns, nodes,
            False, False, metered,
        )  # fmt: skip
        now = record_at(pointer(scratch, AT_NOW), NOW)
        ends[i, 0], ends[i, 1], ends[i, 2] = now.time, now.position, now.velocity
        if metered:
            close_standstill(accs[i], ends[i, 0])
            cycles[i, 0], cycles[i, 1] = limit_cycle(turns[: int(accs[i, TURN_COUNT])], ends[i, 0])
