"""Work-precision diagram of the integrators: CPU time against error in one closed loop, all in one run.

The loop of thesis Table 6: PD on the slow sinusoid, GMS friction of four elements, 5 s, position on a 1 ms grid. Errors
are the largest in position against a tight adaptive run. Ours are whole calls of `simulate` with their rows but without
metrics; ODE1 and ODE5 (explicit Euler and Dormand-Prince at a fixed step, modes tested at the end of a step) are
compiled loops; BDF is SciPy's, restarted at located events, with a compiled right-hand side.

    python benchmarks/work_precision.py [FILE]        draws FILE.svg and FILE.png, prints the table
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from hybrid_loop import laid_out
from solver_comparison import INERTIA, PLANT, bdf, closed, timed
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Reference
from stickslip.report.plots import Curve, Panel, draw
from stickslip.report.styles import Style
from stickslip.simulation.closed_loop import prepare, simulate

AXIS = RigidAxis(INERTIA, PLANT)
CONTROL = Controller(place("PD", INERTIA, 36.0, 1.0))
REFERENCE, DURATION = Reference("sine", amplitude=0.01, frequency=0.4), 5.0
TIMES = np.arange(5000) * 1e-3
STYLES = {
    "exact": Style("#0072B2", "-", 1.6, "o"),
    "adaptive": Style("#009E73", (0, (5, 1.5)), 1.3, "s"),
    "fixed": Style("#CC79A7", (0, (3, 1, 1, 1)), 1.3, "^"),
    "ODE1": Style("#E69F00", (0, (1, 1)), 1.2, "v"),
    "ODE5": Style("#D55E00", (0, (4, 1)), 1.2, "D"),
    "SciPy BDF": Style("#000000", (0, (6, 2)), 1.2, "x"),
}
Attempt = tuple[str, str, Callable[[], Any], int]


def ours(**how: Any) -> Any:
    """Positions of one of our integrators."""
    record = simulate(AXIS, CONTROL, REFERENCE, DURATION, output=TIMES, metered=False, **how)
    return record["position"][record["event"] == 0.0]


def explicit(order: int, step: float) -> Any:
    """Positions of explicit Euler or Dormand-Prince at a fixed step."""
    case = prepare(AXIS, CONTROL, REFERENCE, DURATION, output=TIMES, metered=False)
    position = np.zeros(round(DURATION / step))
    closed(laid_out(case), step, position.size, order, position)
    return position[:: round(1e-3 / step)]


def attempts() -> Iterator[Attempt]:
    """Integrator, setting, what to run, how often."""
    for tolerance in 10.0 ** np.arange(-4.0, -10.5, -1.0):
        yield "exact", f"{tolerance:.0e} rad", lambda t=tolerance: ours(integrator="exact", tolerance=t), 5
    for tolerance in 10.0 ** np.arange(-5.0, -9.5, -1.0):
        yield (
            "adaptive",
            f"{tolerance:.0e} rad",
            lambda t=tolerance: ours(integrator="adaptive", tolerance=t),
            2,
        )
    for step in (1e-3, 3e-4, 1e-4, 3e-5):
        yield "fixed", f"{step:.0e} s", lambda h=step: ours(integrator="fixed", time_step=h), 1
    for order, steps in ((1, (2e-5, 1e-5)), (5, (1e-4, 5e-5, 2e-5))):
        for step in steps:
            yield f"ODE{order}", f"{step:.0e} s", lambda o=order, h=step: explicit(o, h), 1
    case = prepare(AXIS, CONTROL, REFERENCE, DURATION, output=TIMES, metered=False)
    for rtol in (1e-3, 1e-4):
        yield "SciPy BDF", f"rtol {rtol:.0e}", lambda r=rtol: bdf(case, 1e-3, TIMES, r), 0


def measured() -> dict[str, list[tuple[str, float, float]]]:
    """Setting, error (rad) and CPU time (s) of every attempt that is stable, by integrator."""
    truth = ours(integrator="adaptive", tolerance=1e-12)
    found: dict[str, list[tuple[str, float, float]]] = {}
    for name, setting, run, repeat in attempts():
        positions, spent = timed(run, repeat) if repeat else timed_once(run)
        error = float(np.abs(positions - truth).max())
        if error < 1e-2:  # More is no solution: the reference has an amplitude of 1e-2.
            found.setdefault(name, []).append((setting, error, spent))
    return found


def timed_once(run: Callable[[], Any]) -> tuple[Any, float]:
    """What takes seconds is run once; its compilation is a small part."""
    import time

    begin = time.process_time()
    value = run()
    return value, time.process_time() - begin


def main(path: Path) -> None:
    """Print and draw; times as multiples of the exact integrator's at 1e-6 rad."""
    found = measured()
    unit = next(spent for setting, _, spent in found["exact"] if setting == "1e-06 rad")
    print(
        f"{'integrator':12s} {'setting':>12s} {'error, rad':>12s} {'CPU, ms':>10s} {'times exact 1e-6':>17s}"
    )
    for name, rows in found.items():
        for setting, error, spent in rows:
            print(f"{name:12s} {setting:>12s} {error:12.2e} {1e3 * spent:10.3f} {spent / unit:17.1f}")
    curves = [
        Curve(np.array([e for _, e, _ in rows]), np.array([s / unit for _, _, s in rows]), name, STYLES[name])
        for name, rows in found.items()
    ]
    panel = Panel(
        curves,
        "CPU time / that of exact at 1e-6 rad",
        "largest error in position (rad)",
        x_scale="log",
        y_scale="log",
    )
    draw(path, "Work and precision of the integrators", "PD, slow sinusoid, GMS friction, 5 s", [panel], 3.0)


if __name__ == "__main__":
    main(Path(sys.argv[1] if len(sys.argv) > 1 else "work_precision"))
