"""Many closed loops after each other in compiled code: what a batch adds to the kernel of the exact integrator."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

from stickslip.jit import call_value, kernel, pointer, record_at
from stickslip.simulation._meter import close_standstill, meter_of
from stickslip.simulation.exact.kernel import solve
from stickslip.simulation.exact.state import AT_NOW, AT_SIDES, NOW, Laid, Output
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


class Found(NamedTuple):
    """What n loops leave: accumulators of the meter, shape (n, ...); amplitude and period of limit cycles, (n, 2); why
    each ended, (n,); time, position and velocity there, (n, 3)."""

    accs: Any
    cycles: Any
    codes: Any
    ends: Any


@kernel(exact=False)
def solve_all(laid: Laid, starts: Any, output: Output, found: Found, metered: bool) -> None:
    """Run every case from its start; writes how and where it ended, and what the meter and its turns say.

    Parameters and plans have a row a case; ``starts`` (n, ...) holds sides and elements.
    """
    scratch, turns = laid.work, output.turns
    accs, cycles, codes, ends = found
    for i in range(codes.size):
        scratch[:] = 0.0
        for j in range(starts.shape[1]):
            scratch[AT_SIDES + j] = starts[i, j]
        codes[i] = solve(
            Laid(laid.parameters[i], laid.plan[i], laid.cells, laid.breaks, laid.grid, scratch),
            Output(output.motion, output.rows, accs[i], turns, output.nodes), False, False, metered,
        )  # fmt: skip
        now = record_at(pointer(scratch, AT_NOW), NOW)
        ends[i, 0], ends[i, 1], ends[i, 2] = now.time, now.position, now.velocity
        if metered:
            close_standstill(accs[i], ends[i, 0])
            cycles[i, 0], cycles[i, 1] = limit_cycle(turns[: meter_of(accs[i]).turn_count], ends[i, 0])
