"""Choices of any law: sliding curve, viscous part, other parameters for v < 0."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.interpolate import PchipInterpolator

from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings
from stickslip.laws.sliding_curve import stribeck
from stickslip.models import plugins
from stickslip.models.model import Model, Reference
from stickslip.simulation.prescribed.open_loop import respond
from stickslip.subset import law_layouts, lower

LAWS = [plugins.law(name) for name in plugins.law_names()]
U = Surroundings()
DIRECTIONAL = [law for law in LAWS if any(c.name == "symmetry" for c in law.choices)]
CURVED = [law for law in LAWS if any(c.name == "curve" for c in law.choices)]
with_directions = pytest.mark.parametrize("law", DIRECTIONAL, ids=lambda law: law.name)
with_curve = pytest.mark.parametrize("law", CURVED, ids=lambda law: law.name)

# Thesis Table 9 and Table 10: identified sliding curves of the dry and the greased contact.
DRY = {"fs": 0.2951, "fc": 0.3524, "vs": 0.003, "delta_s": 1.1, "sigma2": 0.0263}
GREASED = {
    "beta0": 80.7454, "beta1": -80.4742, "beta2": -80.5930, "beta3": 0.7884, "beta4": 0.7871, "v1": 0.1755,
    "v2": 0.1758, "sigma2": -0.0054, "fv2": 0.0791, "delta_v": 0.3768,
}  # fmt: skip

velocities = st.one_of(st.just(0.0), st.floats(1e-9, 1.0), st.floats(-1.0, -1e-9))
motions = st.lists(st.tuples(velocities, st.floats(-7, 0).map(lambda e: 10.0**e)), min_size=1, max_size=20)


def drive(law, p, motion):
    """Torques along a motion of (end velocity, time step) from rest."""
    z, v, out = law.state(p), 0.0, []
    for end, dt in motion:
        out.append(law.step(v, end, dt, z, p, U))
        v = end
    return out


def level(law, v, p):
    """Steady torque; of a law that has none for a velocity alone (Armstrong), that of sliding on from rest."""
    if law.steady is not None:
        return law.steady(v, p)
    return drive(law, p, [(v, 1e-3)] * 1000)[-1]


def own_values(law):
    """Parameters whose negative direction differs: every directional one a little."""
    values = dict(law.example)
    for f in law.fields:
        if f.like:
            value = law.parameters(law.example)._asdict()[f.like]
            values[f.name] = [1.1 * x for x in value] if f.per_element else 1.1 * value
    return values


# ---- two directions --------------------------------------------------------------------------------------------


def test_laws_that_slide_have_two_directions():
    assert {"coulomb", "stribeck", "lugre", "gms"} <= {law.name for law in DIRECTIONAL}


@with_directions
@given(motion=motions)
@settings(max_examples=50)
def test_equal_parameters_are_the_symmetric_law(law, motion):
    other = law.having(symmetry="asymmetric")
    one = drive(law, law.parameters(law.example), motion)
    assert drive(other, other.parameters(law.example), motion) == pytest.approx(one, rel=1e-12, abs=1e-15)


@with_directions
@given(motion=motions)
@settings(max_examples=50)
def test_the_mirror_image_has_the_parameters_exchanged(law, motion):
    other = law.having(symmetry="asymmetric")
    assert not other.odd
    values = own_values(other)
    exchanged = dict(other.parameters(values)._asdict())
    for f in other.fields:
        if f.like:
            exchanged[f.name], exchanged[f.like] = exchanged[f.like], exchanged[f.name]
    there = drive(other, other.parameters(values), motion)
    back = drive(other, other.parameters(exchanged), [(-v, dt) for v, dt in motion])
    assert there == pytest.approx([-t for t in back], rel=1e-12, abs=1e-15)


@with_directions
def test_each_direction_slides_on_its_own_level(law):
    other = law.having(symmetry="asymmetric")
    p = other.parameters(own_values(other))
    one = law.parameters({k: v for k, v in own_values(other).items() if k in law.example})
    for v in (0.001, 0.03, 2.0):
        assert level(other, v, p) == level(law, v, one) > 0.0
        assert level(other, -v, p) < -1.05 * level(law, v, one)


def test_bounds_hold_in_both_directions():
    with pytest.raises(ParameterError, match="fc_negative = -1"):
        Model("coulomb", {"symmetry": "asymmetric"}, fc=0.3, fc_negative=-1.0)
    with pytest.raises(ParameterError, match=r"for v < 0: curve_velocity starts"):
        Model(
            "lugre", {"symmetry": "asymmetric", "curve": "table"}, sigma0=1e4, curve_velocity=[0, 1],
            curve_torque=[2, 1], curve_velocity_negative=[0.1, 1],
        )  # fmt: skip


def test_stiffness_is_the_same_both_ways():
    names = [f.name for f in plugins.law("gms").having(symmetry="asymmetric").fields]
    assert "fs_negative" in names
    assert "k_negative" not in names
    assert "c_negative" not in names


def test_tables_of_both_directions_may_have_different_numbers_of_points():
    model = Model(
        "gms", {"symmetry": "asymmetric", "curve": "table"}, k=[1e4, 5e3, 4e3], alpha=[0.5, 0.3, 0.2], c=24.0,
        curve_velocity=[0, 0.1], curve_torque=[0.3, 0.2], curve_velocity_negative=[0, 0.1, 0.2],
        curve_torque_negative=[0.4, 0.3, 0.25],
    )  # fmt: skip
    motion = Reference("harmonic", amplitude=0.05, frequency=1.0)
    times = np.linspace(0.0, 2.0, 41)
    by_rate, by_step = (respond(model, motion, times, method=m) for m in ("rate", "step"))
    np.testing.assert_allclose(by_rate["friction_torque"], by_step["friction_torque"], rtol=0, atol=1e-8)


# ---- sliding curves --------------------------------------------------------------------------------------------


def test_dry_contact_of_table_9_rises_from_its_static_level():
    """Break-away below Coulomb, as the thesis measured it (4.3.1.1.5)."""
    law = plugins.law("lugre")
    p = law.parameters({"sigma0": 120.0, "sigma1": 0.01, **DRY})
    assert law.steady(1e-12, p) == pytest.approx(0.2951, abs=1e-6)
    assert law.steady(1.4, p) == pytest.approx(0.3524 + 0.0263 * 1.4, abs=1e-9)


def test_greased_contact_of_table_10_has_the_printed_levels():
    """beta0 + beta1 is the static level, beta0 + beta2 the Coulomb level (after eq. 4.5)."""
    law = plugins.law("lugre").having(curve="double_stribeck", viscous="power")
    p = law.parameters({"sigma0": 85.0, "sigma1": 0.7875, **GREASED})
    assert law.steady(1e-15, p) == pytest.approx(0.2712, abs=1e-4)
    v = 25.0  # the largest velocity of eq. 4.3
    assert law.steady(v, p) == pytest.approx(0.1524 - 0.0054 * v + 0.0791 * v**0.3768, abs=1e-4)
    # "two regions of Stribeck effect (decreasing friction with increasing velocity)", before eq. 4.5.
    torque = np.array([law.steady(float(v), p) for v in np.geomspace(5e-3, 10.0, 400)])
    turns = np.flatnonzero(np.diff(np.sign(np.diff(torque))))
    assert len(turns) == 3
    assert np.all(np.diff(torque[: turns[0]]) < 0.0)


def test_eq_4_5_with_unit_shape_factors_is_eq_4_4():
    one = plugins.law("stribeck").having(curve="double_exponential", viscous="power")
    other = plugins.law("stribeck").having(curve="double_stribeck", viscous="power")
    shared = {"k": 1e5, "sigma2": 0.01, "fv2": 0.02, "v1": 0.01, "v2": 0.3}
    p = one.parameters({**shared, "alpha0": 0.1, "alpha1": 0.2, "alpha2": 0.05})
    q = other.parameters({**shared, "beta0": 0.1, "beta1": 0.2, "beta2": 0.05, "beta3": 1.0, "beta4": 1.0})
    for v in (-20.0, -0.3, 0.001, 0.02, 1.0):
        assert one.steady(v, p) == pytest.approx(other.steady(v, q), rel=1e-12)


@given(
    static=st.floats(0.01, 11.0),
    power=st.floats(0.1, 20.0),
    speed=st.floats(-70.0, 70.0).filter(lambda x: abs(x) > 1e-9),
)
def test_where_nothing_is_left_of_the_static_torque_the_curve_is_the_same_number(static, power, speed):
    p = SimpleNamespace(fs=0.2951 * static, fc=0.2951, vs=0.003, delta_s=power)
    x = abs(0.003 * speed / 0.003)
    assert stribeck(0.003 * speed, p) == p.fc + (p.fs - p.fc) * math.exp(-min(x**power, 800.0))


def test_a_curve_that_is_not_positive_is_refused():
    with pytest.raises(ParameterError, match="a sliding curve is positive"):
        Model(
            "lugre", {"curve": "double_exponential"}, sigma0=1e4, alpha0=0.1, alpha1=0.2, alpha2=-0.2,
            v1=0.01, v2=0.1,
        )  # fmt: skip


points = st.lists(st.tuples(st.floats(0.001, 0.5), st.floats(0.05, 2.0)), min_size=1, max_size=8)


@given(points=points, first=st.floats(0.05, 2.0))
@settings(max_examples=200)
def test_table_goes_through_its_points_and_never_beyond(points, first):
    law = plugins.law("stribeck").having(curve="table")
    v = [0.0, *np.cumsum([h for h, _ in points])]
    s = [first, *(level for _, level in points)]
    p = law.parameters({"k": 1e12, "curve_velocity": v, "curve_torque": s})
    for vi, si in zip(v[1:], s[1:]):
        assert law.steady(vi, p) == pytest.approx(si, rel=1e-12)
    for i in range(len(v) - 1):
        low, high = min(s[i], s[i + 1]), max(s[i], s[i + 1])
        for x in np.linspace(v[i], v[i + 1], 12)[1:-1]:
            assert low * (1 - 1e-12) <= law.steady(float(x), p) <= high * (1 + 1e-12)
    assert law.steady(v[-1] + 10.0, p) == s[-1]


def test_table_is_the_monotone_cubic_of_fritsch_and_butland():
    """Against scipy; in the last interval ours ends level, because the curve goes on constant."""
    v, s = [0.0, 0.002, 0.01, 0.03, 0.1, 0.4], [0.335, 0.33, 0.30, 0.286, 0.29, 0.31]
    law = plugins.law("stribeck").having(curve="table")
    p = law.parameters({"k": 1e12, "curve_velocity": v, "curve_torque": s})
    theirs = PchipInterpolator(v, s)
    for x in np.linspace(1e-6, v[-2], 57):
        assert law.steady(float(x), p) == pytest.approx(float(theirs(x)), rel=1e-12)


def test_points_out_of_order_are_refused():
    with pytest.raises(ParameterError, match="sort the points"):
        Model("stribeck", {"curve": "table"}, k=1.0, curve_velocity=[0, 2, 1], curve_torque=[1, 1, 1])
    with pytest.raises(ParameterError, match="every point needs a value"):
        Model("stribeck", {"curve": "table"}, k=1.0, curve_velocity=[0, 2], curve_torque=[1, 1, 1])


@with_curve
@pytest.mark.parametrize("curve", ["double_exponential", "double_stribeck", "table"])
@pytest.mark.parametrize("viscous", ["linear", "power"])
@pytest.mark.parametrize("symmetry", ["symmetric", "asymmetric"])
def test_every_law_slides_along_every_curve(law, curve, viscous, symmetry):
    chosen = {"curve": curve, "viscous": viscous, "symmetry": symmetry}
    variant = law.having(**chosen)
    p = variant.parameters(own_values(variant))
    z = variant.state(p)
    for v in (0.004, -0.02, 0.5):
        for _ in range(4000):
            torque = variant.step(v, v, 0.01, z, p, U)
        assert torque == pytest.approx(variant.steady(v, p), rel=1e-9)


@with_curve
def test_every_variant_is_in_the_scalar_subset(law):
    for symmetry in ("symmetric", "asymmetric"):
        for curve in ("stribeck", "double_exponential", "double_stribeck", "table"):
            variant = law.having(curve=curve, viscous="power", symmetry=symmetry)
            names = [
                n for n in ("step", "rate", "guards", "switch", "steady", "holding") if getattr(variant, n)
            ]
            lowered = lower({n: getattr(variant, n) for n in names}, law_layouts(variant))
            assert set(names) <= set(lowered)


def test_lugre_passivity_condition_is_that_of_barabanov_and_ortega():
    law = plugins.law("lugre")
    for sigma2, passive in ((0.0176, True), (0.0175, False)):
        p = law.parameters({**law.example, "sigma2": sigma2})
        assert law.is_passive(p) == passive == (sigma2 >= 0.1 * 0.05 / 0.285)
    assert math.isclose(0.1 * 0.05 / 0.285, 0.017543859649122806)
