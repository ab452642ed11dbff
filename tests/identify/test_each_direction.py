"""Friction per direction is a law of the model: identified, written, read back and compensated."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from stickslip.core.errors import InputError
from stickslip.identification.axis import identify_axis
from stickslip.identification.estimate import Identification
from stickslip.identification.evidence import extrapolated
from stickslip.identification.experiment import Experiment
from stickslip.identification.fit.parameter_vector import Vector
from stickslip.identification.identified_file import read_identified
from stickslip.identification.model_file import write_model
from stickslip.identification.monte_carlo import draw_models
from stickslip.identification.output_error.plain import inverse_identification
from stickslip.identification.regression.inverse import inverse_dynamics
from stickslip.machines.servo import ServoAxis
from stickslip.models.model import Model
from support import axis_cases as cases

FORTH, BACK = 0.3, 0.24
AXIS = ServoAxis()


@pytest.fixture(scope="module")
def experiment() -> Experiment:
    own = cases.model
    each = Model("coulomb", {"symmetry": "asymmetric"}, fc=FORTH, fc_negative=BACK, sigma2=cases.SIGMA2)
    try:
        cases.model = lambda name: each
        return cases.experiment("coulomb", seconds=4.0, offset=0.0)
    finally:
        cases.model = own


def read_back(found: Identification, folder: Path) -> Model:
    return read_identified(write_model(folder / "model.toml", found)).model


def test_least_squares_per_direction_is_an_asymmetric_law(experiment: Experiment, tmp_path: Path) -> None:
    found = inverse_identification(inverse_dynamics([experiment], AXIS, per_direction=True), AXIS)
    model = read_back(found, tmp_path)
    assert model.law.chosen["symmetry"] == "asymmetric"
    assert (model.parameters.fc, model.parameters.fc_negative) == pytest.approx((FORTH, BACK), rel=0.06)
    assert found.details["mechanics"].offset == 0.0


@pytest.mark.parametrize("per_direction", [False, True])
def test_least_squares_names_its_numbers_as_the_law_and_the_axis_do(
    experiment: Experiment, tmp_path: Path, per_direction: bool
) -> None:
    """What draws axes from the intervals (`recommend`) looks its numbers up by name."""
    plain = inverse_dynamics([experiment], AXIS, per_direction=per_direction)
    found = inverse_identification(plain, AXIS)
    read = read_identified(write_model(tmp_path / "model.toml", found))
    own = {f.name for f in read.model.law.fields}
    assert {e.name for e in read.law_estimates[0]} == own
    assert {e.name for e in read.estimates} - own <= {"inertia", "offset"}
    for e in read.law_estimates[0]:
        assert e.value == pytest.approx(getattr(read.model.parameters, e.name))
    drawn = draw_models(read.model, read.estimates, read.correlation, 50)
    spread = np.std([m.parameters.fc for m, _ in drawn])
    assert spread == pytest.approx(found["fc"].std, rel=0.4)


def test_least_squares_of_friction_below_the_constant_torque_keeps_its_correlations(
    experiment: Experiment,
) -> None:
    """Means and differences of both directions, with the covariance that such have."""
    assert experiment.drive is not None
    hanging = replace(experiment, drive=experiment.drive + 3.0 * FORTH)
    each = inverse_dynamics([hanging], AXIS, per_direction=True)
    assert min(each["fc_plus"], each["fc_minus"]) < 0.0
    found = inverse_identification(each, AXIS)
    assert found["fc"].value == pytest.approx(0.5 * (each["fc_plus"] + each["fc_minus"]))
    assert found["offset"].value == pytest.approx(0.5 * (each["fc_plus"] - each["fc_minus"]))
    i, j = (each.names.index(n) for n in ("fc_plus", "fc_minus"))
    c = each.covariance
    assert found["fc"].std == pytest.approx(0.5 * np.sqrt(c[i, i] + c[j, j] + 2.0 * c[i, j]))
    assert found["offset"].std == pytest.approx(0.5 * np.sqrt(c[i, i] + c[j, j] - 2.0 * c[i, j]))


def test_least_squares_of_a_pendulum_tells_gravity_and_where_it_hangs(tmp_path: Path) -> None:
    rng = np.random.default_rng(3)
    t = 1e-3 * np.arange(20_000, dtype=np.float64)
    q = 2.0 * np.sin(1.5 * t) + 0.8 * np.sin(4.0 * t)
    v = 3.0 * np.cos(1.5 * t) + 3.2 * np.cos(4.0 * t)
    a = -4.5 * np.sin(1.5 * t) - 12.8 * np.sin(4.0 * t)
    torque = (
        0.02 * a + 0.03 * v + 0.2 * np.sign(v) + 1.5 * np.sin(q - 0.4) + 0.02 * rng.standard_normal(t.size)
    )
    axis = replace(AXIS, gravity="pendulum")
    plain = inverse_dynamics([Experiment("pendulum", t, q, torque)], axis)
    found = inverse_identification(plain, axis)
    assert found["gravity"].value == pytest.approx(1.5, rel=0.01)
    assert found["gravity_angle"].value == pytest.approx(0.4, abs=0.01)
    assert found["gravity"].identified
    assert found["gravity_angle"].identified
    # The delta method against draws of sine and cosine.
    i = [plain.names.index(n) for n in ("gravity_sin", "gravity_cos")]
    s, c = rng.multivariate_normal(plain.values[i], plain.covariance[np.ix_(i, i)], 20_000).T
    assert found["gravity"].std == pytest.approx(float(np.std(np.hypot(s, c))), rel=0.05)
    assert found["gravity_angle"].std == pytest.approx(float(np.std(np.arctan2(-c, s))), rel=0.05)


def test_the_model_of_least_squares_holds_inertia_offset_and_gravity(
    experiment: Experiment, tmp_path: Path
) -> None:
    found = inverse_identification(inverse_dynamics([experiment], AXIS), AXIS)
    write_model(tmp_path / "model.toml", found)
    axis = read_identified(tmp_path / "model.toml").axis
    assert axis["inertia"] == pytest.approx(cases.INERTIA, rel=0.15)
    assert axis["offset"] == pytest.approx(0.5 * (FORTH - BACK), rel=0.2)


def test_an_axis_per_direction_has_a_law_that_differs_and_no_offset(
    experiment: Experiment, tmp_path: Path
) -> None:
    found = identify_axis([experiment], AXIS, ["coulomb"], per_direction=True)
    by_name = {e.name: e for e in found.estimates}
    assert by_name["fc"].lower <= FORTH <= by_name["fc"].upper
    assert by_name["fc_negative"].lower <= BACK <= by_name["fc_negative"].upper
    assert by_name["fc"].lower > by_name["fc_negative"].upper
    assert by_name["fc"].identified
    assert "offset" not in by_name
    # One number for one thing: least squares said others for both levels, in the same output.
    assert not any("Fc" in note for note in found.notes)
    p = read_back(found, tmp_path).parameters
    assert (p.fc, p.fc_negative) == pytest.approx((by_name["fc"].value, by_name["fc_negative"].value))


def test_a_weight_is_no_friction_that_differs_by_direction(logs: Any) -> None:
    """Friction of 0.79 N·m was identified where 0.35 acted beside a weight of 0.45, and -0.1 in the other direction."""
    log = logs.draw(2000160, "actual", 1000, "feedforward", "staircase", "clean")
    weight = 1.6 * log.truth["fc"] - log.truth["offset"]
    record = Experiment("log", log.time, log.position, log.torque + weight)
    with pytest.raises(InputError, match=r"larger than friction.*leave out per_direction=True"):
        identify_axis([record], ServoAxis(drive_side="load"), ["coulomb"], per_direction=True)


def test_an_effect_in_one_direction_alone_is_looked_for_there() -> None:
    """Of v < 0 nothing was ever called extrapolated."""
    values: dict[str, Any] = {"k": 3e4, "fs": 0.4, "fc": 0.3, "vs": 0.5, "sigma2": 0.02}
    other: dict[str, Any] = {
        "fs_negative": 0.4,
        "fc_negative": 0.3,
        "vs_negative": 1e-4,
        "sigma2_negative": 0.02,
    }
    slow = Model("stribeck", {"symmetry": "asymmetric"}, **values, **other)
    vector = Vector(slow)
    outside = extrapolated(vector, vector.start, np.linspace(0.3, 5.0, 50))
    assert "fs_negative" in outside
    assert "fs" not in outside
