"""How far a held load drifts: the fixed integrator at 1 ms, and MuJoCo's actuator where it is installed.

0.01 kg·m² under half of the Coulomb torque (sigma0 1e5, sigma1 10), applied at once and held for 10 s, against a
tight-tolerance solution of the same equations. ``python benchmarks/stiction_drift.py``; MuJoCo (3.5 or later, its
`dcmotor` actuator has LuGre friction) is optional: ``pip install 'stickslip[benchmarks]'``.
"""

from __future__ import annotations

import math
import time

from scipy.integrate import solve_ivp

from stickslip.control.controller import Controller
from stickslip.control.linear import Gains
from stickslip.machines.rigid import RigidAxis
from stickslip.models.model import Model, Reference
from stickslip.simulation.closed_loop import simulate

CONTACT = {"sigma0": 1e5, "sigma1": 10.0, "sigma2": 0.4, "fc": 1.0, "fs": 1.5, "vs": 1e-3}
INERTIA, LOAD, DURATION, STEP = 0.01, 0.5, 10.0, 1e-3


def tight() -> float:
    """Position at the end by SciPy's Radau, rad."""
    p = CONTACT

    def slopes(t: float, y: list[float]) -> list[float]:
        _, v, z = y
        s = p["fc"] + (p["fs"] - p["fc"]) * math.exp(-((v / p["vs"]) ** 2))
        dz = v - p["sigma0"] * abs(v) / s * z
        return [v, (LOAD - p["sigma0"] * z - p["sigma1"] * dz - p["sigma2"] * v) / INERTIA, dz]

    solution = solve_ivp(slopes, (0.0, DURATION), [0.0] * 3, method="Radau", rtol=1e-11, atol=1e-14)
    return float(solution.y[0][-1])


def ours(integrator: str) -> float:
    """Position at the end by `simulate`, rad; the load is a spring too soft to notice the motion."""
    soft = 1e-6
    run = simulate(
        RigidAxis(INERTIA, Model("lugre", **CONTACT)),
        Controller(Gains(kp=soft)),
        Reference.table([0.0, DURATION], [LOAD / soft] * 2, [0.0, 0.0]),
        DURATION,
        integrator=integrator,
        time_step=STEP,
        output=[DURATION],
        metered=False,
    )
    return float(run["position"][-1])


def mujoco_position() -> float | None:
    """Position at the end by MuJoCo's actuator, rad; None where MuJoCo is missing or too old."""
    try:
        import mujoco
    except ImportError:
        return None
    p = CONTACT
    lugre = f"{p['sigma0']:g} {p['sigma1']:g} {p['fc']:g} {p['fs']:g} {p['vs']:g}"
    text = f"""
    <mujoco><option timestep="{STEP}" gravity="0 0 0"/>
    <worldbody><body><joint name="axis" type="hinge" axis="0 0 1" damping="{p["sigma2"]}"/>
    <inertial pos="0 0 0" mass="1" diaginertia="{INERTIA} {INERTIA} {INERTIA}"/></body></worldbody>
    <actuator><dcmotor joint="axis" motorconst="1e-3" resistance="1" lugre="{lugre}"/></actuator></mujoco>"""
    try:
        model = mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        print(f"MuJoCo {mujoco.__version__} does not read the actuator: {error}")
        return None
    data = mujoco.MjData(model)
    data.qfrc_applied[0] = LOAD
    while data.time < DURATION:
        mujoco.mj_step(model, data)
    return float(data.qpos[0])


def main() -> None:
    """Print one line a method."""
    elastic = LOAD / CONTACT["sigma0"]
    truth = tight() - elastic
    print(f"true drift beyond the elastic deflection: {truth:.4e} rad")
    for name in ("adaptive", "fixed"):
        begin = time.perf_counter()
        drift = ours(name) - elastic
        print(f"{name:>9}: {drift / truth:.4f} of it, {time.perf_counter() - begin:.2f} s")
    other = mujoco_position()
    print("   MuJoCo: not run" if other is None else f"   MuJoCo: {(other - elastic) / truth:.1f} of it")


if __name__ == "__main__":
    main()
