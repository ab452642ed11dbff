"""A motor and a load behind a spring: against a solver of its own, its limits, its file."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

import stickslip as ss
from stickslip.core.errors import ConfigError, ParameterError
from stickslip.machines.numbers import machine_numbers, with_numbers
from stickslip.simulation.machine.layout import lay_out_machine, run

MOTOR, LOAD, SPRING, DAMPING = 2e-4, 5e-4, 300.0, 0.02
PERIOD, KP, KD = 5e-4, 6.0, 0.12
LUGRE = {"sigma0": 3e3, "sigma1": 0.3, "fs": 0.36, "fc": 0.3, "vs": 0.01, "sigma2": 0.01}
INERTIAS = st.floats(1e-5, 1e-2)


def two(friction: ss.Model, encoder: Any = "motor", **more: Any) -> ss.Machine:
    axis = ss.TwoMassAxis(MOTOR, LOAD, SPRING, DAMPING, encoder)
    return ss.Machine("two", axis.inertia, ss.Contact(friction), flexible=axis, sample_time=PERIOD, **more)


def target(t: float) -> tuple[float, float]:
    w = 2.0 * math.pi * 3.0
    return 0.05 * (1.0 - math.cos(w * t)), 0.05 * w * math.sin(w * t)


def by_scipy(encoder: int, samples: int) -> np.ndarray[Any, Any]:
    """Angle of the encoder at the samples, LuGre friction at the load, PD with a backward difference."""
    damper = 2.0 * DAMPING * math.sqrt(SPRING * MOTOR * LOAD / (MOTOR + LOAD))
    p, y, old, out = LUGRE, np.zeros(5), 0.0, []

    def rate(_: float, y: Any, torque: float) -> list[float]:
        motor, load, v1, v2, z = y
        between = SPRING * (motor - load) + damper * (v1 - v2)
        level = p["fc"] + (p["fs"] - p["fc"]) * math.exp(-((v2 / p["vs"]) ** 2))
        dz = v2 - p["sigma0"] * abs(v2) / level * z
        friction = p["sigma0"] * z + p["sigma1"] * dz + p["sigma2"] * v2
        return [v1, v2, (torque - between) / MOTOR, (between - friction) / LOAD, dz]

    for k in range(samples + 1):
        out.append(y[encoder])
        q, v = target(k * PERIOD)
        torque = KP * (q - y[encoder]) + KD * (v - ((y[encoder] - old) / PERIOD if k else 0.0))
        old = y[encoder]
        y = solve_ivp(rate, (0.0, PERIOD), y, method="LSODA", rtol=1e-11, atol=1e-14, args=(torque,)).y[:, -1]
    return np.array(out)


@pytest.mark.parametrize("encoder", ["motor", "load"])
def test_it_moves_as_a_solver_of_differential_equations_says(encoder: str) -> None:
    loop = ss.Controller(ss.Gains(KP, kd=KD, kr=KD), sample_time=PERIOD)
    move = ss.Reference("sine", amplitude=0.05, frequency=3.0)
    record = ss.simulate(
        two(ss.Model("lugre", **LUGRE), encoder), loop, move, duration=400 * PERIOD, output=PERIOD, check=True
    )
    truth = by_scipy(["motor", "load"].index(encoder), 400)
    error = np.max(np.abs(record["position"] - truth))
    assert np.ptp(truth) > 0.05
    assert error < record.meta["accuracy"]["error_rad"] < 1e-6


@pytest.mark.parametrize("law", ["gms", "dahl", "maxwell_slip", "coulomb"])
def test_a_stiff_coupling_makes_two_masses_of_three(law: str) -> None:
    """What is left falls with the coupling's compliance."""
    found = ss.law(law)
    machine = two(ss.Model(found, {}, **found.example))
    torques = 0.6 * np.sin(np.arange(400) * 0.05) + 0.3

    def moved(machine: ss.Machine) -> np.ndarray[Any, Any]:
        rows = np.zeros((len(torques), 6))
        run(lay_out_machine(machine), torques, rows)
        return rows[:, 1]

    own = moved(machine)
    off = [
        np.max(np.abs(moved(replace(machine, flexible=ss.FlexibleAxis(
            0.5 * MOTOR, 0.5 * MOTOR, LOAD, coupling, SPRING, DAMPING
        ))) - own)) for coupling in (1e4, 1e6)
    ]  # fmt: skip
    assert np.ptp(own) > 0.1
    assert off[1] < 0.1 * off[0] < 1e-3 * np.ptp(own)


@given(motor=INERTIAS, load=INERTIAS, spring=st.floats(1.0, 1e5), contact=st.floats(1.0, 1e6))
def test_modes_and_stiffness_in_closed_form(motor: float, load: float, spring: float, contact: float) -> None:
    axis = ss.TwoMassAxis(motor, load, spring)
    assert axis.modes[0] == 0.0
    assert axis.modes[1] == pytest.approx(
        math.sqrt(spring * (motor + load) / (motor * load)) / (2.0 * math.pi)
    )
    assert axis.antiresonance == pytest.approx(axis.modes[1] * math.sqrt(motor / axis.inertia))
    assert axis.behind(axis.visible(contact)) == pytest.approx(contact, rel=1e-6)
    assert replace(axis, encoder="load").visible(contact) == pytest.approx(contact)
    assert axis.scaled(3.0).modes[1] == pytest.approx(axis.modes[1] / math.sqrt(3.0))


def test_its_response_has_the_antiresonance_on_the_motor_alone() -> None:
    friction = ss.Model("viscous", sigma2=1e-6)
    f = two(friction).flexible.antiresonance
    seen = {
        e: abs(two(friction, e).linear().state_space().response(np.array([0.3 * f, f])))
        for e in ("motor", "load")
    }
    low = 1.0 / ((MOTOR + LOAD) * (2.0 * math.pi * 0.3 * f) ** 2)
    assert seen["motor"][0] == pytest.approx(low, rel=0.2)
    assert seen["motor"][1] < 0.05 * seen["load"][1]


def test_its_file_and_its_numbers(tmp_path: Path) -> None:
    machine = two(ss.Model("lugre", **LUGRE), "load", flexible_stiffness=2e3, delay=2.5)
    assert ss.load_machine(machine.write(tmp_path / "two.toml")) == machine
    numbers = machine_numbers(machine)
    assert {"flexible.motor", "flexible.load", "flexible.stiffness", "flexible.damping"} <= numbers.keys()
    softer = with_numbers(machine, {"flexible.stiffness": 100.0, "inertia": 2.0 * machine.inertia})
    assert softer.flexible == ss.TwoMassAxis(2.0 * MOTOR, 2.0 * LOAD, 100.0, DAMPING, "load")


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('encoder = "motor"', 'encoder = "shaft"', r"two_mass.encoder = 'shaft' is not known"),
        ("motor = 0.0002", "motor = 0.0", "two_mass.motor = 0.0 must be greater than 0"),
        ("motor = 0.0002", "motor = 0.0003", "add up to 0.0008"),
        ("[two_mass]", "[flexible]\nrotor = 1.0\n[two_mass]", "two_mass.* and flexible exclude each other"),
        ("stiffness = 300.0", "stiff = 300.0", "stiffness is missing"),
    ],
)
def test_a_wrong_file_is_refused_in_a_line(tmp_path: Path, old: str, new: str, said: str) -> None:
    file = two(ss.Model("coulomb", fc=0.3)).write(tmp_path / "two.toml")
    text = file.read_text()
    assert old in text
    file.write_text(text.replace(old, new))
    with pytest.raises(ConfigError, match=said):
        ss.load_machine(file)


def test_wrong_numbers_are_refused() -> None:
    with pytest.raises(ParameterError, match="two-mass axis: load = -1"):
        ss.TwoMassAxis(1e-4, -1.0, 300.0)
    with pytest.raises(ParameterError, match="damping = 1"):
        ss.TwoMassAxis(1e-4, 1e-4, 300.0, 1.0)
