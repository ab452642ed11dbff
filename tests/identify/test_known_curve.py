"""Methods that need a sliding curve take that of any law, for each direction (thesis figure 4.37, Table 10)."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip import Controller, Gains, Model, Record, Reference, RigidAxis, simulate
from stickslip.cli import main
from stickslip.core.errors import InputError
from stickslip.identification.presliding.known_curve import describe_unused, static_levels, transfer_curve
from stickslip.models import plugins
from stickslip.simulation.prescribed.motion import Along

INERTIA = 4.2757e-4
GREASE = {
    "beta0": 80.7454, "beta1": -80.4742, "beta2": -80.5930, "beta3": 0.7884, "beta4": 0.7871, "v1": 0.1755,
    "v2": 0.1758, "sigma2": -0.0054, "fv2": 0.0791, "delta_v": 0.3768,
}  # fmt: skip
"""Thesis Table 10."""
DOUBLE = {"curve": "double_stribeck", "viscous": "power"}
ASYMMETRIC = {
    "fs": 0.30, "fc": 0.26, "vs": 0.02, "delta_s": 2.0, "sigma2": 0.02,
    "fs_negative": 0.33, "fc_negative": 0.29, "vs_negative": 0.03, "delta_s_negative": 1.5, "sigma2_negative": 0.03,
}  # fmt: skip
UNITS = {"position": "rad", "motor_torque": "N·m"}


def example(law: str, symmetry: str) -> Model:
    """The example of a law, with friction a tenth lower in the negative direction if it is asymmetric."""
    made = plugins.law(law).having(symmetry=symmetry)
    values: dict[str, Any] = Model(law, **dict(plugins.law(law).example)).parameters._asdict()
    for f in made.fields:
        if f.name.endswith("_negative"):
            twin = values[f.name.removesuffix("_negative")]
            values[f.name] = (0.9 * np.array(twin)).tolist() if f.par.unit == "N·m" else twin
    return Model(made, **values)


@pytest.mark.parametrize("symmetry", ["symmetric", "asymmetric"])
@pytest.mark.parametrize(
    "law", [n for n in plugins.law_names() if plugins.law(n).steady is not None and n != "viscous"]
)
@pytest.mark.parametrize("target", ["lugre", "gms"])
def test_the_curve_of_every_law_is_carried_over(target: str, law: str, symmetry: str) -> None:
    own = {"sigma0": 1e4} if target == "lugre" else {"k": [1e4], "alpha": [1.0], "c": 24.0}
    curve = example(law, symmetry)
    made = transfer_curve(target, curve, **own)
    speeds = np.geomspace(0.01, 3.0, 50)  # Makkar and Karnopp have ended their slope at rest there
    for direction in (1.0, -1.0):
        expected = curve.sliding_torque(direction * speeds)
        assert made.sliding_torque(direction * speeds) == pytest.approx(expected, rel=1e-4)
    assert static_levels(made) == pytest.approx(static_levels(curve), rel=1e-6)


def test_what_is_not_carried_over_is_named() -> None:
    curve = Model("gms", {"temperature_dependence": "exponential"}, k=[1e4], alpha=[1.0], c=24.0, fs=0.3, fc=0.25,
                  vs=0.01, temperature_coefficient=-0.01)  # fmt: skip
    notes = describe_unused(curve, transfer_curve("lugre", curve, sigma0=1e4))
    assert "not k, alpha, c" in notes[0]
    assert "temperature" in notes[1]
    with pytest.raises(InputError, match="no friction at rest"):
        transfer_curve("gms", Model("viscous", sigma2=0.1), k=[1e4], alpha=[1.0], c=24.0)
    with pytest.raises(InputError, match="no torque at constant velocity"):
        transfer_curve("lugre", example("armstrong", "symmetric"), sigma0=1e4)


def stick_slip(friction: Model, amplitude: float, offset: float = 0.0) -> Record:
    """Two periods at 1 Hz, and a constant torque of the motor that a weight takes up."""
    w = 2.0 * np.pi
    drive = Reference("harmonic", amplitude=amplitude / w, frequency=1.0, phase=-0.5 * np.pi)
    done = simulate(
        RigidAxis(INERTIA, friction), Controller(Gains(kp=0.0, kr=1.0)), drive, 2.0, integrator="fixed",
        time_step=2e-5, metered=False, output=1e-3,
    )  # fmt: skip
    channels = {"position": done["position"], "motor_torque": done["motor_torque"] + offset}
    return Record(done.time, channels, UNITS)


def write_model(
    folder: Path, law: str, choices: dict[str, str], values: dict[str, float], **axis: float
) -> str:
    """A file as `stickslip identify` writes it, with the keys that a person may write."""
    chosen = "".join(f"{name} = {option!r}\n" for name, option in choices.items())
    numbers = "".join(f"{name} = {value!r}\n" for name, value in values.items())
    table = "[axis]\n" + "".join(f"{name} = {value!r}\n" for name, value in axis.items()) if axis else ""
    file = folder / "curve.toml"
    file.write_text(f"law = {law!r}\n[choices]\n{chosen}[parameters]\n{numbers}{table}")
    return str(file)


@pytest.mark.slow
def test_a_curve_of_each_direction_makes_the_response_drift(tmp_path: Path) -> None:
    """Figure 4.37: with one curve for both directions the simulated position returned to 0."""
    record = stick_slip(
        Model("lugre", {"symmetry": "asymmetric"}, sigma0=1e3, sigma1=0.1, **ASYMMETRIC), 0.45, 0.02
    )
    curve = write_model(tmp_path, "stribeck_plain", {"symmetry": "asymmetric"}, ASYMMETRIC, offset=0.02)
    found = ss.identify(record, method="lugre", model=curve, inertia=INERTIA).identification
    measured, simulated = found.pictures[0].traces
    assert abs(measured.y[-1]) > 0.2
    assert simulated.y[-1] == pytest.approx(measured.y[-1], abs=0.01 * abs(measured.y[-1]))
    assert found["sigma0"].value == pytest.approx(1e3, rel=0.05)


@pytest.mark.slow
def test_lugre_takes_the_curve_of_table_10(tmp_path: Path) -> None:
    record = stick_slip(Model("lugre", DOUBLE, sigma0=1e3, sigma1=0.1, **GREASE), 0.35)
    curve = write_model(tmp_path, "stribeck_plain", DOUBLE, GREASE)
    found = ss.identify(record, method="lugre", model=curve, inertia=INERTIA).identification
    assert found["sigma0"].value == pytest.approx(1e3, rel=0.05)
    assert found.misfit["position_rms_rad"] < 0.02 * np.ptp(record["position"])


@pytest.mark.parametrize("choices", [DOUBLE, {"symmetry": "asymmetric"}], ids=["table 10", "asymmetric"])
def test_presliding_takes_any_curve(
    choices: dict[str, str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    values = GREASE if choices is DOUBLE else ASYMMETRIC
    time = 0.01 * np.arange(2000)
    position = 1.5e-3 * np.sin(2.0 * np.pi * 0.2 * time)
    plant = Model("gms", choices, k=[315.0, 113.0, 69.7], alpha=[0.1567, 0.4211, 0.4222], c=35.0, **values)
    torque = Along(plant.law, time, position).of(plant) + 0.01
    rows = (
        f"{t!r},{x!r},{y!r}"
        for t, x, y in zip(time.tolist(), position.tolist(), torque.tolist(), strict=True)
    )
    log = tmp_path / "loop.csv"
    log.write_text("\n".join(["time [s],position [rad],torque [Nm]", *rows]))
    curve = write_model(tmp_path, "stribeck_plain", choices, values, offset=0.01)
    command = ["identify", str(log), "--method", "presliding", "--model", curve, "--elements", "3", "--json"]
    assert main([*command, "--no-report", "--out", str(tmp_path / "m.toml")]) == 0
    found = {e["name"]: e["value"] for e in json.loads(capsys.readouterr().out)["estimates"]}
    assert found["k[0]"] == pytest.approx(315.0, rel=0.02)
    assert sum(found[f"k[{i}]"] for i in range(3)) == pytest.approx(497.7, rel=0.01)
