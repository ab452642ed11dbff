"""Elements of a contact, of which one loop tells the total alone."""

import math

import numpy as np
import pytest

from stickslip import Model
from stickslip.commission.stiffness import resolved, within_total
from stickslip.identification.estimate import Estimate, Identification

LAW = Model("gms", fs=0.3, fc=0.25, vs=0.1, sigma2=0.01, k=[800.0, 400.0], alpha=[0.6, 0.4], c=10.0)


def elements_given(limits, correlation):
    """Of a fit that set these limits, as factors of each value, to all elements."""
    values = {"k[0]": 800.0, "k[1]": 400.0, "alpha[0]": 0.6, "alpha[1]": 0.4}
    estimates = tuple(
        Estimate(name, "", "", x, 1e12, limits[0] * x, limits[1] * x, False, "") for name, x in values.items()
    )
    found, correlation = within_total(
        Identification("presliding", LAW, estimates, np.asarray(correlation), {}), 0.03
    )
    return {e.name: e for e in found}, correlation


def spread_of_sum(found, correlation, names):
    """Standard deviation of a sum whose terms have these deviations and correlations."""
    places = [list(found).index(n) for n in names]
    std = np.array([found[n].std for n in names])
    return math.sqrt(std @ correlation[np.ix_(places, places)] @ std)


def test_values_without_limits_stay_unsure_beside_a_known_total():
    """A fit that tells nothing apart has all its correlations at 1: they do not make shares known to a millionth."""
    ways = np.array([1.0, -1.0, 1.0, -1.0])
    found, correlation = elements_given((0.0, math.inf), np.outer(ways, ways))
    for e in found.values():
        assert e.std > 0.02 * e.value
    assert not found["k[1]"].identified
    assert not found["alpha[1]"].identified
    assert spread_of_sum(found, correlation, ("k[0]", "k[1]")) == pytest.approx(0.03 * 1200.0)


@pytest.mark.parametrize("together", [-0.9, 0.0, 0.9])
def test_the_sums_stay_as_sure_as_they_are(together):
    """Of the stiffnesses to 3 %, of the shares exactly, however the elements go together; each is surer than before."""
    pair = np.array([[1.0, together], [together, 1.0]])
    found, correlation = elements_given((0.8, 1.25), np.kron(np.eye(2), pair))
    assert spread_of_sum(found, correlation, ("k[0]", "k[1]")) == pytest.approx(0.03 * 1200.0)
    assert spread_of_sum(found, correlation, ("alpha[0]", "alpha[1]")) < 1e-6
    for e in found.values():
        assert 0.0 < e.std < math.log(1.25 / 0.8) / 3.92 * e.value


def test_a_correlation_that_is_no_number_counts_as_none():
    unknown = np.full((4, 4), math.nan)
    assert elements_given((0.8, 1.25), unknown)[0] == elements_given((0.8, 1.25), np.eye(4))[0]


def test_elements_that_are_left_out_are_said_by_their_torque():
    """A stiffness of 2.21e-42 N·m/rad was printed, which is what a fit ends at where nothing tells it."""
    law = Model("gms", fs=0.3, fc=0.25, vs=0.1, sigma2=0.01, k=[800.0, 400.0, 2.21e-42, 50.0],
                alpha=[0.35, 0.212, 0.433, 0.005], c=10.0)  # fmt: skip
    found = resolved(Identification("presliding", law, (), np.eye(0), {}), 0.3)
    assert found.model is not None
    assert len(found.model.parameters.k) == 2
    (note,) = found.notes
    assert "e-42" not in note
    assert "friction of 0.13 N·m that would build up only far beyond the loop's way" in note
    assert "elements of 0.0015 N·m, less than 1 % of the loop's torque" in note
