"""Friction per direction is a law of the model: identified, written, read back and compensated."""

from __future__ import annotations

from pathlib import Path

import axis_cases as cases
import pytest

from stickslip.identify.axis import identify_axis
from stickslip.identify.axis_inverse import inverse_dynamics
from stickslip.identify.axis_plain import inverse_identification
from stickslip.identify.axis_trial import Trial
from stickslip.identify.estimate import Identification
from stickslip.identify.identified_file import read_identified
from stickslip.identify.model_file import write_model
from stickslip.machines.servo import ServoAxis
from stickslip.model import Model

FORTH, BACK = 0.3, 0.24
AXIS = ServoAxis()


@pytest.fixture(scope="module")
def trial() -> Trial:
    own = cases.model
    each = Model("coulomb", {"symmetry": "asymmetric"}, fc=FORTH, fc_negative=BACK, sigma2=cases.SIGMA2)
    try:
        cases.model = lambda name: each
        return cases.trial("coulomb", seconds=4.0, offset=0.0)
    finally:
        cases.model = own


def read_back(found: Identification, folder: Path) -> Model:
    return read_identified(write_model(folder / "model.toml", found)).model


def test_least_squares_per_direction_is_an_asymmetric_law(trial: Trial, tmp_path: Path) -> None:
    found = inverse_identification(inverse_dynamics([trial], AXIS, per_direction=True), AXIS)
    model = read_back(found, tmp_path)
    assert model.law.chosen["symmetry"] == "asymmetric"
    assert (model.parameters.fc, model.parameters.fc_negative) == pytest.approx((FORTH, BACK), rel=0.06)
    assert found.details["mechanics"].offset == 0.0


def test_the_model_of_least_squares_holds_inertia_offset_and_gravity(trial: Trial, tmp_path: Path) -> None:
    found = inverse_identification(inverse_dynamics([trial], AXIS), AXIS)
    write_model(tmp_path / "model.toml", found)
    axis = read_identified(tmp_path / "model.toml").axis
    assert axis["inertia"] == pytest.approx(cases.INERTIA, rel=0.15)
    assert axis["offset"] == pytest.approx(0.5 * (FORTH - BACK), rel=0.2)


def test_an_axis_per_direction_has_a_law_that_differs_and_no_offset(trial: Trial, tmp_path: Path) -> None:
    found = identify_axis([trial], AXIS, ["coulomb"], per_direction=True)
    by_name = {e.name: e for e in found.estimates}
    assert by_name["fc"].lower <= FORTH <= by_name["fc"].upper
    assert by_name["fc_negative"].lower <= BACK <= by_name["fc_negative"].upper
    assert by_name["fc"].lower > by_name["fc_negative"].upper
    assert by_name["fc"].identified
    assert "offset" not in by_name
    assert any("cannot be told from friction that differs by direction" in note for note in found.notes)
    p = read_back(found, tmp_path).parameters
    assert p.fc - p.fc_negative == pytest.approx(FORTH - BACK, abs=0.01)
