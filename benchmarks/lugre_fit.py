"""sigma0 and sigma1 of LuGre from 3 s at 1 kHz: ours beside SciPy's least squares over solve_ivp(BDF), one run.

python benchmarks/lugre_fit.py
"""

from __future__ import annotations

import math
import time

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares

from stickslip import Controller, Gains, Model, Reference, RigidAxis, simulate
from stickslip.identification.presliding.lugre_dynamics import Response, fit_position

INERTIA = 3.8623e-4
SLIDING = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
NOISE = 1e-5  # rad
START = (2e4, 0.3)


def record() -> Response:
    """A LuGre contact under 0.35 N·m at 1 Hz, with noise on the position."""
    w = 2.0 * math.pi
    drive = Reference("harmonic", amplitude=0.35 / w, frequency=1.0, phase=-0.5 * math.pi)
    axis = RigidAxis(INERTIA, Model("lugre", sigma0=3.5e4, sigma1=0.1, **SLIDING))
    run = simulate(axis, Controller(Gains(kp=0.0, kr=1.0)), drive, 3.0, integrator="adaptive", metered=False)
    exact = Response.of(run)
    noise = np.random.default_rng(0).normal(0.0, NOISE, exact.time.size)
    return Response(exact.time, exact.torque, exact.position + noise)


def bdf_position(r: Response, sigma0: float, sigma1: float) -> np.ndarray:
    """The same axis by SciPy's BDF at the times of the record."""
    fs, fc, vs, sigma2 = (SLIDING[k] for k in ("fs", "fc", "vs", "sigma2"))

    def slope(t: float, y: np.ndarray) -> list[float]:
        v, z = y[1], y[2]
        dz = v - sigma0 * abs(v) / (fc + (fs - fc) * math.exp(-((v / vs) ** 2))) * z
        torque = 0.35 * math.sin(2.0 * math.pi * t)
        return [v, (torque - sigma0 * z - sigma1 * dz - sigma2 * v) / INERTIA, dz]

    out = solve_ivp(
        slope, (0.0, r.time[-1]), [0.0, 0.0, 0.0], "BDF", r.time, rtol=1e-6, atol=1e-9, max_step=0.01
    )
    return out.y[0]


def main() -> None:
    """Time both, print the ratio."""
    r = record()
    fit_position(
        r, INERTIA, SLIDING, sigma0=START[0], sigma1=START[1], noise=NOISE, profiles=False
    )  # compiles
    begin = time.process_time()
    ours = fit_position(r, INERTIA, SLIDING, sigma0=START[0], sigma1=START[1], noise=NOISE, profiles=False)
    mine = time.process_time() - begin
    begin = time.process_time()
    theirs = least_squares(
        lambda u: bdf_position(r, *np.exp(u)) - r.position, np.log(START), x_scale="jac", diff_step=1e-4
    )
    other = time.process_time() - begin
    rms = math.sqrt(2.0 * theirs.cost / r.time.size)
    rows = {
        "ours": (mine, ours.rms, ours.values["sigma0"], ours.values["sigma1"]),
        "SciPy, BDF": (other, rms, *np.exp(theirs.x)),
    }
    for name, (seconds, error, sigma0, sigma1) in rows.items():
        print(f"{name:12}{seconds:9.3f} s CPU  rms {error:.4g} rad  sigma0 {sigma0:.5g}  sigma1 {sigma1:.3g}")
    ratio = other / mine
    equal = ours.rms <= 1.02 * rms
    print(f"{ratio:.0f} times faster (at least 50 wanted), residual {'equal or lower' if equal else 'HIGHER'}: "
          f"{'PASS' if ratio >= 50.0 and equal else 'FAIL'}")  # fmt: skip


if __name__ == "__main__":
    main()
