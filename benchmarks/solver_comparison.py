"""The solver comparison of thesis 3.2.1: ODE1, ODE5 and a stiff variable-step solver at 1e-3, 1e-4 and 1e-5 s.

The 4-element GMS law under the velocity profiles (3.16) and (3.17), and the closed loop of Table 6. ODE1 is
explicit Euler and ODE5 the fifth-order Dormand-Prince formula at a fixed step, modes tested at the end of each
step; "ode15s-like" is SciPy's BDF (rtol 1e-3, MATLAB's default) restarted at located events, with the step as its
longest. The errors are against a tight solution of this package; times are CPU of the compiled loop (ODE1, ODE5)
or of the whole call (BDF, compiled right-hand side). Our own integrators stand below for comparison.

    python benchmarks/solver_comparison.py
"""

from __future__ import annotations

import math
import time
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from hybrid_loop import HybridLoop, laid_out
from stickslip.control.controller import Controller
from stickslip.control.linear import place
from stickslip.jit import call_guards, call_rate, call_switch, compiled_law, flat, kernel, pointer
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.adaptive.dormand_prince import NODES, TABLEAU
from stickslip.simulation.adaptive.hybrid import rates
from stickslip.simulation.adaptive.layout import HEAD, Laid, loop_of
from stickslip.simulation.adaptive.step import stages
from stickslip.simulation.adaptive.switching import begin_side, events, switch
from stickslip.simulation.closed_loop import prepare, simulate
from stickslip.simulation.prescribed.open_loop import respond

PLANT = Model(
    "gms",
    k=[1e4, 7e3, 5e3, 3e3],
    alpha=[0.25] * 4,
    c=24.0,
    fs=0.335,
    fc=0.285,
    vs=0.01,
    delta_s=2.0,
    sigma2=0.018,
)
INERTIA = 3.8623e-4
STEPS = (1e-3, 1e-4, 1e-5)
PROFILES = {"3.16": (0.0251, 0.4), "3.17": (0.3142, 0.1)}


@kernel()
def prescribed(
    law: Any, p: Any, amplitude: float, w: float, h: float, n: int, order: int, torque: Any
) -> None:
    """The law along v = amplitude sin(w t) at a fixed step; torque at every step."""
    size = 2 * int(p[6])
    z, dz, g, u = np.zeros(size), np.zeros(size), np.zeros(size), np.zeros(3)
    stage = np.zeros((6, size))
    start = np.zeros(size)
    for i in range(n):
        v = amplitude * math.sin(w * i * h)
        call_guards(law[2], v, pointer(z, 0), pointer(p, 0), pointer(u, 0), pointer(g, 0))
        for j in range(size // 2):
            g[j] = -1.0
        call_switch(law[3], v, pointer(z, 0), pointer(p, 0), pointer(u, 0), pointer(g, 0))
        torque[i] = call_rate(law[1], v, pointer(z, 0), pointer(p, 0), pointer(u, 0), pointer(dz, 0))
        if order == 1:
            for j in range(size // 2):
                z[j] += h * dz[j]
            continue
        start[:] = z
        for s in range(6):
            c = NODES[s]
            for j in range(size // 2):
                z[j] = start[j]
                for m in range(s):
                    z[j] += h * TABLEAU[s, m] * stage[m, j]
            now = amplitude * math.sin(w * (i + c) * h)
            call_rate(law[1], now, pointer(z, 0), pointer(p, 0), pointer(u, 0), pointer(dz, 0))
            stage[s, :] = dz
        for j in range(size // 2):
            z[j] = start[j]
            for m in range(6):
                z[j] += h * TABLEAU[6, m] * stage[m, j]


@kernel()
def closed(laid: Laid, h: float, n: int, order: int, position: Any) -> None:
    """The closed loop at a fixed step, modes tested at the end of each."""
    loop = loop_of(laid)
    y, end, size = loop.y, loop.end, loop.case.states
    begin_side(loop, 0.0, h, y)
    for i in range(n):
        position[i] = y[0]
        rates(loop, i * h, y, loop.rates)
        if order == 1:
            for j in range(size):
                end[j] = y[j] + h * loop.rates[j]
        else:
            stages(loop, i * h, h)
        for j in range(size):
            y[j] = end[j]
        if events(loop, (i + 1) * h, y) >= 0.0:
            switch(loop, (i + 1) * h, y)
        if not abs(y[0]) < 1e3:
            position[i:] = np.nan
            return


def bdf(case: Any, longest: float, times: Any, rtol: float = 1e-3) -> Any:
    """SciPy's BDF on the closed loop, restarted at every located event; positions at the times.

    It integrates position, velocity and the elements' torques; the modes are held between events.
    """
    loop, n = HybridLoop(case), case.plant.state.size // 2
    full, g = loop.y.copy(), loop.due
    moving = np.array([0, 1, *range(HEAD, HEAD + n)])
    out, t, end = np.full(times.size, np.nan), 0.0, float(times[-1])
    loop.begin(0.0, 1e-6, full)

    def slope(now: float, state: Any) -> Any:
        full[moving] = state
        return loop.rates(now, full)[moving]

    def due(now: float, state: Any) -> float:
        full[moving] = state
        return loop.events(now, full)

    due.terminal, due.direction = True, 1.0  # type: ignore[attr-defined]
    y = full[moving]
    while t < end:
        found = solve_ivp(
            slope, (t, end), y, method="BDF", events=due, max_step=longest, rtol=rtol,
            atol=rtol * np.array([1e-6, 1e-4, *[1e-3] * n]), dense_output=True, first_step=min(1e-6, end - t),
        )  # fmt: skip
        until = found.t[-1]
        inside = (times >= t) & (times <= until)
        if inside.any():
            out[inside] = found.sol(times[inside])[0]
        y, t = found.y[:, -1].copy(), until
        if found.status != 1:
            break
        full[moving] = y
        loop.events(t, full)
        g[g > -1e-9] = np.maximum(g[g > -1e-9], 0.0)  # the located root lies within rounding of zero
        loop.switch(t, full)
    return out


def timed(run: Any, repeat: int = 3) -> tuple[Any, float]:
    """The result and the least CPU time of a few runs, s; the first compiles and does not count."""
    value = run()
    best = math.inf
    for _ in range(repeat):
        begin = time.process_time()
        value = run()
        best = min(best, time.process_time() - begin)
    return value, best


def open_loop_rows() -> list[tuple[str, str, float, float]]:
    """Torque error (N·m) and CPU time of the fixed-step solvers under the velocity profiles."""
    law = np.array(compiled_law(PLANT.law), dtype=np.int64)
    p = flat(PLANT.law.pack(PLANT.parameters))
    rows = []
    for name, (amplitude, frequency) in PROFILES.items():
        w, duration = 2 * math.pi * frequency, 1.0 / frequency
        motion = Reference("harmonic", amplitude=amplitude / w, frequency=frequency, phase=-0.5 * math.pi)
        grid = np.arange(1, round(duration / 1e-3)) * 1e-3
        truth = respond(PLANT, motion, grid)["friction_torque"]
        for order in (1, 5):
            for h in STEPS:
                n = round(duration / h)
                torque = np.zeros(n)
                _, spent = timed(
                    lambda o=order, h=h, n=n, x=torque: prescribed(law, p, amplitude, w, h, n, o, x)  # noqa: B023
                )
                ours = torque[:: round(1e-3 / h)][1 : grid.size + 1]
                rows.append(
                    (f"profile {name}, ODE{order}", f"{h:g}", float(np.abs(ours - truth).max()), spent)
                )
    return rows


def closed_loop_rows() -> list[tuple[str, str, float, float]]:
    """Position error (rad) and CPU time on the closed loop of Table 6, PD at low velocity, 5 s."""
    axis = RigidAxis(INERTIA, PLANT)
    control = Controller(place("PD", INERTIA, 36.0, 1.0))
    reference, duration = Reference("sine", amplitude=0.01, frequency=0.4), 5.0
    times = np.arange(5000) * 1e-3
    tight = simulate(axis, control, reference, duration, integrator="adaptive", tolerance=1e-11, output=times)
    truth = tight["position"][tight["event"] == 0.0]
    case = prepare(axis, control, reference, duration, output=times, metered=False)
    rows = []
    for order in (1, 5):
        for h in STEPS:
            n = round(duration / h)
            position = np.zeros(n)

            def run(order: int = order, h: float = h, n: int = n, position: Any = position) -> None:
                closed(laid_out(case), h, n, order, position)

            _, spent = timed(run)
            error = np.abs(position[:: round(1e-3 / h)] - truth).max()
            rows.append((f"closed loop, ODE{order}", f"{h:g}", float(error), spent))
    for h in STEPS[:2]:
        found, spent = timed(lambda h=h: bdf(case, h, times), repeat=1)
        rows.append(("closed loop, ode15s-like", f"<= {h:g}", float(np.abs(found - truth).max()), spent))
    for integrator, tolerance in (("exact", 1e-6), ("exact", 1e-9), ("adaptive", 1e-9)):
        record, spent = timed(
            lambda i=integrator, tol=tolerance: simulate(
                axis, control, reference, duration, integrator=i, tolerance=tol, output=times, metered=False
            )
        )
        ours = record["position"][record["event"] == 0.0]
        rows.append(
            (
                f"closed loop, ours, {integrator}",
                f"{tolerance:g} rad",
                float(np.abs(ours - truth).max()),
                spent,
            )
        )
    return rows


def main() -> None:
    """Print the table."""
    print(f"{'case and solver':34s} {'step, s':>10s} {'max. error':>12s} {'CPU, ms':>10s}")
    for name, step, error, spent in [*open_loop_rows(), *closed_loop_rows()]:
        print(f"{name:34s} {step:>10s} {error:12.3g} {spent * 1e3:10.3f}")
    print("errors: N·m under the profiles, rad in the closed loop; nan: unstable")


if __name__ == "__main__":
    main()
