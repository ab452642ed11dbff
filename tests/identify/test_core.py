"""The vector of parameters, least squares, and what they say about uncertainty."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy import optimize, stats

from stickslip import Model, Par, law, law_names
from stickslip.core.errors import InputError, UnknownName
from stickslip.identification.estimate import Identification
from stickslip.identification.fit.broyden import descend_by_secants
from stickslip.identification.fit.levenberg_marquardt import Squares, central_differences, descend
from stickslip.identification.fit.noise import Noise, noise_of_repeats
from stickslip.identification.fit.parameter_vector import Parameter, Vector
from stickslip.identification.fit.profile import profiles_of
from stickslip.identification.fit.selection import criteria, cross_validate
from stickslip.identification.fit.uncertainty import fit
from stickslip.simulation.prescribed.steady import Steady

ANY = Par("-", "x", "a number")
POSITIVE = Par("-", "x", "a number", positive=True)
VALLEY = Squares(
    lambda u: np.array([10.0 * (u[1] - u[0] ** 2), 1.0 - u[0]]), np.full(2, -9.0), np.full(2, 9.0)
)
"""Curved (More, Garbow and Hillstrom 1981, problem 1), with its zero at (1, 1)."""


def vector_of(**values: tuple[Par, float]) -> Vector:
    return Vector(None, extra=[Parameter(n, par, v) for n, (par, v) in values.items()])


@pytest.mark.parametrize("name", law_names())
def test_vector_returns_the_model_it_was_made_of(name: str) -> None:
    model = Model(name, **law(name).example)
    vector = Vector(model)
    again = vector.model(vector.start)
    assert model.law.pack(again.parameters) == pytest.approx(model.law.pack(model.parameters), rel=1e-13)
    assert vector.packed(vector.start) == pytest.approx(model.law.pack(model.parameters), rel=1e-13)


@pytest.mark.parametrize("name", law_names())
@given(seed=st.integers(0, 2**32 - 1))
@settings(max_examples=10)
def test_every_vector_inside_the_bounds_keeps_every_bound(name: str, seed: int) -> None:
    vector = Vector(Model(name, **law(name).example))
    u = vector.start + np.random.default_rng(seed).normal(0.0, 2.0, vector.size)
    u = np.clip(u, vector.lower, vector.upper)
    named = vector.named(u)
    assert [p.name for p in vector.parameters if p.par.complaint(named[p.name])] == []
    jacobian = central_differences(
        Squares(vector.values, vector.lower - 1, vector.upper + 1), u, range(vector.size)
    )
    assert vector.jacobian(u) == pytest.approx(jacobian, rel=1e-6, abs=1e-7 * np.max(np.abs(jacobian)))


def test_shares_add_up_to_one_with_one_frozen() -> None:
    model = Model("gms", **law("gms").example)
    vector = Vector(model, free=["alpha"], frozen=["alpha[1]"])
    assert vector.names == ("alpha[0]", "alpha[2]", "alpha[3]")
    named = vector.named(vector.start + np.array([0.7, -0.2]))
    assert sum(v for n, v in named.items() if n.startswith("alpha")) == pytest.approx(1.0, abs=1e-14)
    assert named["alpha[1]"] == 0.25


def test_unknown_free_parameter_is_refused() -> None:
    with pytest.raises(UnknownName, match="sigma0"):
        Vector(Model("coulomb", fc=1.0), free=["sigma0"])


def test_descend_agrees_with_scipy() -> None:
    x = np.linspace(0.0, 3.0, 25)
    y = 2.0 * np.exp(-1.3 * x) + 0.4 + np.random.default_rng(1).normal(0.0, 0.02, x.size)

    def residuals(u: np.ndarray) -> np.ndarray:
        return u[0] * np.exp(-u[1] * x) + u[2] - y

    start, free = np.array([1.0, 0.1, 0.0]), np.full(3, np.inf)
    theirs = optimize.least_squares(residuals, start, xtol=1e-15, ftol=1e-15, gtol=1e-15)
    ours = descend(Squares(residuals, -free, free), start)
    assert ours.u == pytest.approx(theirs.x, rel=1e-7)
    held = descend(Squares(residuals, np.array([-9.0, -9.0, 0.45]), free), start)
    bounded = optimize.least_squares(
        residuals, [1.0, 0.1, 0.5], bounds=([-9, -9, 0.45], np.inf), xtol=1e-15, ftol=1e-15
    )
    assert held.u == pytest.approx(bounded.x, rel=1e-5)


def test_rosenbrock_to_the_last_digit() -> None:
    """A curved valley (More, Garbow and Hillstrom 1981, problem 1) has its zero at (1, 1)."""
    out = descend(VALLEY, np.array([-1.2, 1.0]))
    assert out.u == pytest.approx([1.0, 1.0], abs=1e-12)


@pytest.mark.parametrize("name", ["stribeck", "gms"])
def test_a_jacobian_of_all_columns_at_once_is_the_one_of_each(name: str) -> None:
    """Sliding torques by the compiled law, a coordinate held between equal bounds among them."""
    model = Model(name, **law(name).example)
    velocity = np.concatenate([np.geomspace(1e-3, 2.0, 12), -np.geomspace(1e-3, 2.0, 12), [0.0]])
    steady = Steady(model.law, velocity, np.where(velocity < 0.0, -1.0, 1.0))
    vector = Vector(model)
    lower, upper = vector.lower, vector.upper
    lower[0] = upper[0] = vector.start[0]

    def one(u):
        return steady.torque(vector.packed(u))

    def several(us):
        return steady.torques(np.array([vector.packed(u) for u in us]))

    alone, together = Squares(one, lower, upper), Squares(one, lower, upper, at_all=several)
    places = range(vector.size)
    assert np.array_equal(
        central_differences(alone, vector.start, places), central_differences(together, vector.start, places)
    )


def test_secants_reach_the_same_minimum_with_fewer_evaluations() -> None:
    x = np.linspace(0.0, 3.0, 25)
    y = 2.0 * np.exp(-1.3 * x) + 0.4 + np.random.default_rng(1).normal(0.0, 0.02, x.size)
    calls = [0]

    def residuals(u: np.ndarray) -> np.ndarray:
        calls[0] += 1
        return u[0] * np.exp(-u[1] * x) + u[2] - y

    start, free = np.array([1.0, 0.1, 0.0]), np.full(3, np.inf)
    ours = descend(Squares(residuals, -free, free), start, tolerance=1e-10)
    full, calls[0] = calls[0], 0
    u, cost = descend_by_secants(Squares(residuals, -free, free), start, tolerance=1e-10)
    assert calls[0] < 0.7 * full
    assert u == pytest.approx(ours.u, rel=1e-4)
    assert cost == pytest.approx(ours.cost, rel=1e-8)
    bounded, _ = descend_by_secants(
        Squares(residuals, np.array([-9.0, -9.0, 0.45]), free), start, tolerance=1e-10
    )
    assert bounded == pytest.approx(
        descend(Squares(residuals, np.array([-9.0, -9.0, 0.45]), free), start).u, rel=1e-4
    )
    held, _ = descend_by_secants(Squares(residuals, -free, free), start, held=[2], tolerance=1e-10)
    assert held[2] == 0.0
    assert held == pytest.approx(descend(Squares(residuals, -free, free), start, held=[2]).u, rel=1e-4)


def test_secants_follow_a_curved_valley() -> None:
    u, cost = descend_by_secants(VALLEY, np.array([-1.2, 1.0]), tolerance=1e-12)
    assert u == pytest.approx([1.0, 1.0], abs=1e-6)
    assert cost < 1e-12


@pytest.mark.parametrize("given_noise", [0.1, None])
def test_linear_fit_has_the_intervals_of_theory(given_noise: float | None) -> None:
    """Of a straight line they are exact: normal with known noise, Student's otherwise."""
    x = np.linspace(-1.0, 1.0, 12)
    y = 1.0 + 2.0 * x + np.random.default_rng(2).normal(0.0, 0.05, x.size)
    vector = vector_of(a=(ANY, 0.0), b=(ANY, 0.0))
    out = fit(lambda u: u[0] + u[1] * x - y, vector, noise=given_noise, signed_scale=10.0)
    theory = stats.linregress(x, y)
    std = 0.1 / np.linalg.norm(x) if given_noise else theory.stderr
    width = (1.959964 if given_noise else stats.t.ppf(0.975, 10)) * std
    slope = out.estimates[1]
    assert slope.value == pytest.approx(theory.slope, rel=1e-8)
    assert slope.std == pytest.approx(std, rel=1e-6)
    assert (slope.lower, slope.upper) == pytest.approx(
        (slope.value - width, slope.value + width), rel=0.01 * width
    )
    assert slope.identified


def test_intervals_cover_the_truth_as_often_as_they_say() -> None:
    """A rate constant, 100 noise draws: 95 % nominal."""
    x, rng = np.linspace(0.0, 4.0, 15), np.random.default_rng(3)
    inside = 0
    for _ in range(100):
        y = np.exp(-0.7 * x) + rng.normal(0.0, 0.05, x.size)
        out = fit(lambda u, y=y: np.exp(u[0] - x * math.exp(u[1])) - y,
                  vector_of(a=(POSITIVE, 1.0), k=(POSITIVE, 1.0)), starts=2)  # fmt: skip
        inside += out.estimates[1].lower <= 0.7 <= out.estimates[1].upper
    assert 89 <= inside <= 100


def test_what_lies_below_a_minimum_by_less_than_its_tolerance_is_no_other_minimum() -> None:
    """Fits of simulations end early: the profile of a coordinate with hardly an effect began anew four times."""
    t = np.linspace(0.0, 1.0, 50)
    wrong = 0.1 * np.sin(37.0 * t)
    limits = np.full(2, 10.0)
    squares = Squares(lambda u: u[0] * t + 1e-6 * u[1] * t**2 - 2.0 * t + wrong, -limits, limits)
    exact = descend(squares, np.array([1.0, 2.0]))
    early = descend(squares, exact.u + np.array([2e-3, 0.0]), iterations=0)
    early = replace(early, jacobian=exact.jacobian)
    noise = Noise(0.1, "given")
    assert 1.0 < early.cost / exact.cost < 1.01
    assert profiles_of(squares, early, noise, 0).better is not None
    found = profiles_of(squares, early, noise, 0, tolerance=0.01)
    assert found.better is None
    low, high = profiles_of(squares, exact, noise, 0).bounds[0]
    assert found.bounds[0] == pytest.approx((low, high), abs=0.02 * (high - low))
    assert found.bounds[1] == (-math.inf, math.inf)


def test_a_parameter_without_effect_is_not_identified() -> None:
    x = np.linspace(0.0, 1.0, 9)
    out = fit(
        lambda u: math.exp(u[0]) * x + 0.0 * u[1] - 2.0 * x,
        vector_of(a=(POSITIVE, 1.0), b=(POSITIVE, 3.0)),
        noise=0.01,
    )
    a, b = out.estimates
    assert a.identified
    assert not b.identified
    assert (b.lower, b.upper) == (0.0, math.inf)


def test_a_perfect_fit_alone_does_not_set_the_noise() -> None:
    x = np.linspace(0.0, 1.0, 9)
    out = fit(lambda u: math.exp(u[0]) * x - 2.0 * x, vector_of(a=(POSITIVE, 1.0)))
    assert out.values["a"] == pytest.approx(2.0, rel=1e-12)
    assert not out.estimates[0].identified
    assert "noise" in out.estimates[0].verdict


def test_equally_good_minima_are_all_reported() -> None:
    """u squared cannot tell its sign."""
    x = np.linspace(0.5, 1.0, 9)
    out = fit(lambda u: u[0] ** 2 * x - 4.0 * x, vector_of(a=(ANY, 1.0)), noise=0.01, signed_scale=10.0)
    assert len(out.others) == 1
    assert out.estimates[0].lower == pytest.approx(-2.0, abs=0.05)
    assert out.estimates[0].upper == pytest.approx(2.0, abs=0.05)
    assert not out.estimates[0].identified


def test_repeats_set_the_noise() -> None:
    rng = np.random.default_rng(4)
    groups = rng.normal(0.0, 0.3, (200, 3)) + rng.normal(0.0, 5.0, (200, 1))
    noise = noise_of_repeats(list(groups))
    assert noise is not None
    assert noise.std == pytest.approx(0.3, rel=0.1)
    assert noise.dof == 400
    assert noise_of_repeats([[1.0], [2.0]]) is None


def test_correlated_residuals_widen_the_interval() -> None:
    """Noise of an autoregression with coefficient 0.9: the mean's standard deviation grows by sqrt(19)."""
    rng = np.random.default_rng(5)
    steps = rng.normal(0.0, 1.0, 6_000)
    y = np.zeros(steps.size)
    for i in range(1, y.size):
        y[i] = 0.9 * y[i - 1] + steps[i]
    plain = fit(lambda u: u[0] - y, vector_of(a=(ANY, 0.0)), starts=1)
    wide = fit(lambda u: u[0] - y, vector_of(a=(ANY, 0.0)), starts=1, lags=60)
    assert wide.estimates[0].std / plain.estimates[0].std == pytest.approx(math.sqrt(19.0), rel=0.25)
    assert wide.estimates[0].upper - wide.estimates[0].lower > 3.5 * (
        plain.estimates[0].upper - plain.estimates[0].lower
    )


def test_correlations_of_what_is_hardly_told_apart_stay_within_one() -> None:
    """Two parameters whose columns differ by 1e-10 of themselves, with correlated residuals."""
    rng = np.random.default_rng(3)
    x = np.linspace(0.0, 1.0, 400)
    noise = np.convolve(rng.normal(0.0, 0.01, x.size), np.full(5, 0.2), mode="same")
    vector = Vector(Model("coulomb", fc=0.3, sigma2=0.01))

    def residuals(u: np.ndarray) -> np.ndarray:
        return np.sin(x + 1.0) * float(np.sum(u)) + 1e-10 * x * float(u[0]) + noise

    found = fit(residuals, vector, noise=None, profiles=False, lags=10)
    correlation = found.correlation
    assert np.array_equal(correlation, correlation.T)
    assert np.diag(correlation) == pytest.approx(1.0, abs=1e-12)
    assert np.all(np.abs(correlation) <= 1.0 + 1e-12)


def test_criteria_prefer_the_true_order_and_cross_validation_agrees() -> None:
    x = np.linspace(-1.0, 1.0, 40)
    y = 1.0 + x + 3.0 * x**2 + np.random.default_rng(6).normal(0.0, 0.1, x.size)
    scores = {}
    for order in range(6):

        def error(fitted: np.ndarray, left_out: np.ndarray, order: int = order) -> np.ndarray:
            return np.polyval(np.polyfit(x[fitted], y[fitted], order), x[left_out]) - y[left_out]

        everything = np.arange(x.size)
        cost = float(np.sum(error(everything, everything) ** 2))
        found = criteria(cost, x.size, order + 1)
        scores[order] = (found.aicc, found.bic, cross_validate(error, x.size))
    assert [min(scores, key=lambda k: scores[k][i]) for i in range(3)] == [2, 2, 2]


def test_nothing_to_fit_is_one_clear_error() -> None:
    with pytest.raises(InputError, match="frozen"):
        fit(lambda u: u, Vector(Model("coulomb", fc=1.0), free=[]))
    with pytest.raises(InputError, match="noise"):
        fit(lambda u: u - 1.0, vector_of(a=(ANY, 0.0)), noise=-1.0)


def test_result_as_plain_data() -> None:
    out = fit(lambda u: np.exp(u) - np.ones(1), vector_of(a=(POSITIVE, 2.0)))
    result = Identification("test", None, out.estimates, out.correlation, {"rms_Nm": out.rms})
    assert result.as_dict()["estimates"][0]["std"] is None
    assert result.not_identified == ("a",)
    with pytest.raises(UnknownName, match="choose from a"):
        result["b"]
