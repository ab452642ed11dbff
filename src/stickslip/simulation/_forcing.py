"""The torque of a feedforward compensator, computed once for a reference.

A law that runs on the reference velocity depends on time alone. Its torque is kept as quartics over cells of
time, accurate to about 1e-10 N·m. A cell is four equal parts; every part is walked with the law's own `step` in
1, 2 and 4 steps and extrapolated (the laws' steps are of second order and stable for any length, so that the
3.9e4/s of LuGre do no harm). Cells end at the reference's breaks, where torques may jump (Coulomb: sign of the
velocity); they shrink around a break-away, whose kink is handed on as a time to step onto.
"""

from __future__ import annotations

from collections import OrderedDict
from typing import Any, NamedTuple

import numpy as np

from stickslip.core.errors import InputError
from stickslip.jit import call_profile, call_step, kernel, pointer
from stickslip.simulation.case_arrays import Array, Case, surroundings

CELL_SIZE = 7
"""Start (s), 1/width (1/s), and five coefficients of powers of (t - start)/width (N·m)."""
NO_CELLS: Array = np.zeros((0, CELL_SIZE))
TOLERANCE = 1e-10
"""N·m, for the torque of a cell and for what a cell adds to the state's error."""
LONGEST, SHORTEST = 0.02, 1e-8
"""Widths of cells, s."""
BLURRED = 1e-4
"""Shorter cells than this (s) may be less accurate in proportion: their impulse counts."""
KINK = 4e-6
"""Cells this short (s) hold a kink."""
INSIDE = 1e-12
"""Limits at a break are taken this far inside, s."""
MOST_CELLS = 400_000


class Driven(NamedTuple):
    """A law on the reference velocity: addresses, and arrays that outlive them."""

    step: int
    parameters: Any
    surroundings: Any
    profile: int
    reference: Any
    """parameters of the reference"""
    modes: Any
    """which of the law's states are modes"""
    motion: Any
    """the reference where it was asked for last; scratch"""


@kernel()
def velocity_at(law: Driven, t: float) -> float:
    """Reference velocity, rad/s."""
    call_profile(law.profile, t, pointer(law.reference, 0), pointer(law.motion, 0))
    return law.motion[1]


@kernel()
def stepped(law: Driven, v0: float, v1: float, dt: float, z: Any) -> float:
    """Advance z by one step of the law; returns the torque at its end."""
    return call_step(
        law.step, v0, v1, dt, pointer(z, 0), pointer(law.parameters, 0), pointer(law.surroundings, 0)
    )


@kernel()
def walk(law: Driven, t0: float, t1: float, v0: float, steps: int, z: Any) -> float:
    """Walk the law from t0 to t1 in equal steps; advances z, returns the torque at t1."""
    dt = (t1 - t0) / steps
    torque = 0.0
    v = v0
    for i in range(steps):
        ahead = velocity_at(law, t1 if i == steps - 1 else t0 + (i + 1) * dt)
        torque = stepped(law, v, ahead, dt, z)
        v = ahead
    return torque


@kernel()
def part(law: Driven, t0: float, t1: float, states: Any) -> tuple[float, float]:
    """Advance states[0] over one part by extrapolation; returns the torque at t1 and the error."""
    n = states.shape[1]
    v0 = velocity_at(law, t0)
    for k in range(1, 4):
        for i in range(n):
            states[k, i] = states[0, i]
    # Errors fall with the square of the step, then with its cube: 1, 2 and 4 steps cancel both.
    one = walk(law, t0, t1, v0, 1, states[1])
    two = walk(law, t0, t1, v0, 2, states[2])
    four = walk(law, t0, t1, v0, 4, states[3])
    better_two = two + (two - one) / 3.0
    better_four = four + (four - two) / 3.0
    error = abs(better_four - better_two)
    for i in range(n):
        if law.modes[i]:
            states[0, i] = states[3, i]
        else:
            coarse = states[2, i] + (states[2, i] - states[1, i]) / 3.0
            fine = states[3, i] + (states[3, i] - states[2, i]) / 3.0
            states[0, i] = fine + (fine - coarse) / 7.0
    return better_four + (better_four - better_two) / 7.0, error


@kernel()
def quartic(torque: Any, t: float, width: float, cell: Any) -> float:
    """Write the cell through five torques; returns how much its quartic term bends it, N·m."""
    y0, y1, y2, y3, y4 = torque[0], torque[1], torque[2], torque[3], torque[4]
    d1 = y1 - y0
    d2 = y2 - 2.0 * y1 + y0
    d3 = y3 - 3.0 * y2 + 3.0 * y1 - y0
    d4 = y4 - 4.0 * y3 + 6.0 * y2 - 4.0 * y1 + y0
    # Newton's forward differences in s = 4 (t - start)/width, rewritten in powers.
    cell[0] = t
    cell[1] = 1.0 / width
    cell[2] = y0
    cell[3] = 4.0 * (d1 - d2 / 2.0 + d3 / 3.0 - d4 / 4.0)
    cell[4] = 16.0 * (d2 / 2.0 - d3 / 2.0 + 11.0 * d4 / 24.0)
    cell[5] = 64.0 * (d3 / 6.0 - d4 / 4.0)
    cell[6] = 256.0 * d4 / 24.0
    return abs(d4) / 16.0


@kernel()
def tabulate(law: Driven, state: Any, edges: Any, cells: Any) -> int:
    """Fill `cells` over [edges[0], edges[-1]]; returns their number, or -1 where they do not suffice."""
    n = state.shape[0]
    states = np.zeros((4, max(n, 1)))
    kept = np.zeros(max(n, 1))
    torque = np.zeros(5)
    for i in range(n):
        states[0, i] = state[i]
    count = 0
    width = 1e-4
    for k in range(edges.shape[0] - 1):
        t = edges[k] + INSIDE
        end = edges[k + 1] - INSIDE
        width = min(width, 1e-4)
        # The torque on this side of the break: a step of no length.
        v = velocity_at(law, t)
        torque[0] = stepped(law, v, v, 0.0, states[0])
        while t < end:
            last = t + 1.0001 * width >= end
            w = end - t if last else width
            for i in range(n):
                kept[i] = states[0, i]
            error = 0.0
            for j in range(4):
                stop = end if last and j == 3 else t + 0.25 * (j + 1) * w
                torque[j + 1], wrong = part(law, t + 0.25 * j * w, stop, states)
                error = max(error, wrong)
            if count == cells.shape[0]:
                return -1
            bend = quartic(torque, t, w, cells[count])
            bend *= min(1.0, w / BLURRED)
            worst = max(0.1 * error, bend * 0.1)
            if worst > TOLERANCE and w > SHORTEST:
                for i in range(n):
                    states[0, i] = kept[i]
                width = 0.5 * w if worst < 32.0 * TOLERANCE else 0.25 * w
                continue
            count += 1
            t += w
            torque[0] = torque[4]
            if worst < 0.02 * TOLERANCE and not last:
                width = min(2.0 * w, LONGEST)
    return count


def kinks_of(cells: Array) -> list[float]:
    """Both ends of the most bent cell in every run of cells that had to be very short: a kink lies inside."""
    widths = 1.0 / cells[:, 1]
    short = np.flatnonzero(widths < KINK)
    runs = np.split(short, np.flatnonzero(np.diff(short) > 1) + 1)
    kinks: list[float] = []
    for run in runs:
        if run.size:
            i = run[np.argmax(np.abs(cells[run, 6]))]
            kinks += [float(cells[i, 0]), float(cells[i, 0] + widths[i])]
    return kinks


_tables: OrderedDict[Any, tuple[Array, list[float]]] = OrderedDict()
MOST_TABLES = 64


def feedforward(case: Case) -> tuple[Array, list[float]]:
    """Torque of the case's compensator along its reference (without its gain).

    Returns
    -------
    cells : array, shape (n, 7)
        See `CELL_SIZE`; ascending. Kept for the same law, parameters, reference and duration.
    kinks : list of float
        Times at which integrators had better step, s.

    Raises
    ------
    InputError
        If the torque changes too often to be tabulated over so long a run.
    """
    side = case.compensator
    duration = float(case.breaks[-1])
    key = (
        side.pointers, side.parameters.tobytes(), case.profile, case.reference_parameters.tobytes(), duration,
    )  # fmt: skip
    if key not in _tables:
        # Half and 80 % of the run are breaks of the metrics only.
        edges = np.array([0.0, *case.reference.breaks(duration), duration])
        law = Driven(
            side.pointers.step, side.parameters, surroundings(case.numbers), case.profile, case.reference_parameters,
            side.modes, np.zeros(3),
        )  # fmt: skip
        room = 2000
        while True:
            cells = np.empty((room, CELL_SIZE))
            n = tabulate(law, side.state, edges, cells)
            if n >= 0:
                break
            room *= 8
            if room > MOST_CELLS:
                raise InputError(
                    f"duration = {duration:g} s: the compensator's torque along the reference changes too often to be "
                    f'tabulated (more than {MOST_CELLS} pieces); give a shorter run, or integrator = "fixed"'
                )
        _tables[key] = (cells[:n].copy(), kinks_of(cells[:n]))
        if len(_tables) > MOST_TABLES:
            _tables.popitem(last=False)
    return _tables[key]
