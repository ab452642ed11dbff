"""LuGre's sigma0 and sigma1 from an open-loop response: what the thesis's record says, and what it does not."""

import math

import numpy as np
import pytest

from stickslip import Controller, Gains, Model, Reference, RigidAxis, simulate
from stickslip.core.errors import InputError
from stickslip.identification.estimate import Identification
from stickslip.identification.presliding.lugre_dynamics import Response, fit_position, identify_lugre_dynamics

INERTIA = 3.8623e-4
SLIDING = {"fs": 0.335, "fc": 0.285, "vs": 0.01, "delta_s": 2.0, "sigma2": 0.018}
CURVE = Model("stribeck_plain", **SLIDING)
PLANT = Model("gms", k=[1e4, 7e3, 5e3, 3e3], alpha=[0.25] * 4, c=24.0, **SLIDING)


def response_of(friction: Model, duration: float) -> Response:
    """0.35 N·m at 1 Hz: a controller that passes the reference's velocity on as torque."""
    w = 2.0 * math.pi
    drive = Reference("harmonic", amplitude=0.35 / w, frequency=1.0, phase=-0.5 * math.pi)
    record = simulate(
        RigidAxis(INERTIA, friction), Controller(Gains(kp=0.0, kr=1.0)), drive, duration, integrator="adaptive",
        metered=False, output=1e-3,
    )  # fmt: skip
    return Response.of(record)


@pytest.fixture(scope="module")
def thesis_record() -> Response:
    return response_of(PLANT, 2.0)


@pytest.fixture(scope="module")
def thesis_result(thesis_record: Response) -> Identification:
    return identify_lugre_dynamics(thesis_record, INERTIA, CURVE)


@pytest.mark.slow
def test_the_thesis_record_does_not_determine_sigma0_by_its_position(thesis_result: Identification) -> None:
    result = thesis_result
    assert not result.details["plain_determines_sigma0"]
    assert "does not determine sigma0" in result.notes[0]
    scan = result.details["scan"]
    stiff = scan[:, 0] > 5e3
    assert np.all(np.diff(scan[stiff, 1]) < 0.0)  # it falls for ever
    # The reference: 35.4 mrad at Table 4's sigma0, 25.9 mrad at 1e6.
    assert np.interp(3.5e4, scan[:, 0], scan[:, 1]) == pytest.approx(0.0354, rel=0.03)
    assert np.interp(1e6, scan[:, 0], scan[:, 1]) == pytest.approx(0.0259, rel=0.03)


@pytest.mark.slow
def test_the_pre_sliding_parts_carry_the_stiffness(thesis_result: Identification) -> None:
    result = thesis_result
    assert result["sigma0"].value == pytest.approx(25_000.0, rel=0.1)
    assert result["stiffness"].value == pytest.approx(25_000.0, rel=0.02)
    assert not result["sigma1"].identified
    assert any("sigma1 is not determined" in note for note in result.notes)


@pytest.mark.slow
def test_a_coarse_encoder_hides_the_stiffness(thesis_record: Response) -> None:
    count = 2.0 * math.pi / 20_000
    coarse = Response(
        thesis_record.time, thesis_record.torque, count * np.round(thesis_record.position / count)
    )
    result = identify_lugre_dynamics(coarse, INERTIA, CURVE, noise=count / math.sqrt(12.0))
    assert not result["sigma0"].identified
    assert not result["stiffness"].identified


@pytest.mark.slow
def test_a_lugre_contact_is_found_by_its_position() -> None:
    truth = Model("lugre", sigma0=3.5e4, sigma1=0.1, **SLIDING)
    exact = response_of(truth, 1.0)
    noisy = exact.position + np.random.default_rng(0).normal(0.0, 1e-5, exact.time.size)
    found = fit_position(
        Response(exact.time, exact.torque, noisy), INERTIA, CURVE, sigma0=2e4, sigma1=0.3, noise=1e-5
    )
    assert found.rms == pytest.approx(1e-5, rel=0.1)
    assert found.values["sigma0"] == pytest.approx(3.5e4, rel=0.01)
    assert found.estimates[0].identified


@pytest.mark.slow
@pytest.mark.parametrize("start", [5e3, 1e5])
def test_a_bad_first_sample_moves_nothing(start: float) -> None:
    """Eight standard deviations off; the search starts from a seventh and from three times the stiffness."""
    exact = response_of(Model("lugre", sigma0=3.5e4, sigma1=0.1, **SLIDING), 1.0)
    noisy = exact.position + np.random.default_rng(1).normal(0.0, 1e-4, exact.time.size)
    noisy[0] = exact.position[0] + 8e-4
    found = fit_position(
        Response(exact.time, exact.torque, noisy),
        INERTIA,
        CURVE,
        sigma0=start,
        sigma1=0.3,
        noise=1e-4,
        profiles=False,
    )
    sigma0 = found.estimates[0]
    assert sigma0.lower < 3.5e4 < sigma0.upper
    assert sigma0.value == pytest.approx(3.5e4, rel=0.02)


def test_bad_responses_get_one_clear_error() -> None:
    t = np.linspace(0.0, 1.0, 100)
    with pytest.raises(InputError, match="strictly ascending"):
        Response(0.0 * t, t, t)
    with pytest.raises(InputError, match="never sticks"):
        identify_lugre_dynamics(Response(t, t + 1.0, t), INERTIA, CURVE)
