"""Tables of a sliding curve: points where they are needed, within the bounds of the controller that reads them."""

import itertools
import math

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from stickslip.core.errors import InputError
from stickslip.exports import beckhoff, table
from stickslip.exports._points import between_points
from stickslip.exports.job import CannotCarry, Job
from stickslip.exports.nearest import Curve
from stickslip.models.model import Model

STRIBECK = Model("stribeck_plain", fs=0.335, fc=0.285, vs=0.01, sigma2=0.018)
LUGRE = Model("lugre", sigma0=3.5e4, sigma1=0.1, sigma2=0.018, fs=0.335, fc=0.285, vs=0.01)


def entries(text):
    """The lines of a list as a user reads them."""
    return {line.split()[0]: float(line.split()[1]) for line in text.splitlines() if line[0] != "#"}


def list_of(model, nearest=False, top=None, **values):
    values = {"torque_per_unit": 2.4e-3, **values}
    export = beckhoff.write(Job(model, "x", nearest=nearest, top_speed=top, settings=values))
    return export.files["x_frict_comp.lis"]


# ---- which points ----------------------------------------------------------------------------------------------


def test_few_points_err_as_little_as_theory_allows():
    """On a parabola evenly spaced points are the best; n pieces of width h err by f'' h^2 / 8."""
    top = 2.0
    model = Model("viscous", {"viscous": "power"}, sigma2=0.0, fv2=1.0, delta_v=2.0)
    curve = Curve.of(model, top, density=4)
    for count in (3, 5, 9):
        v, (torque,) = between_points(curve, count, both_directions=False)
        assert v.size <= count
        fine = np.linspace(0.0, top, 5001)
        error = np.max(np.abs(np.interp(fine, v, torque) - fine**2))
        assert error <= 1.1 * 2.0 * (top / (count - 1)) ** 2 / 8.0


@settings(max_examples=15)
@given(vs=st.floats(1e-3, 1.0), rise=st.floats(1.0, 3.0), delta=st.floats(0.5, 4.0))
def test_more_points_never_err_more(vs, rise, delta):
    curve = Curve.of(
        Model("stribeck_plain", fs=rise, fc=1.0, vs=vs, delta_s=delta, sigma2=0.1), 1.0, density=4
    )
    errors = []
    for count in (4, 8, 16):
        v, (torque,) = between_points(curve, count, both_directions=False)
        assert np.all(np.diff(v) > 0.0)
        assert v[0] == 0.0
        assert v[-1] == pytest.approx(1.0)
        errors.append(np.max(np.abs(np.interp(curve.velocity, v, torque) - curve.forward)))
    assert errors[2] <= errors[1] + 1e-9 <= errors[0] + 2e-9


# ---- CSV -------------------------------------------------------------------------------------------------------


def test_a_table_is_read_back_as_written_and_says_how_near_it_is():
    model = Model(
        "coulomb", {"symmetry": "asymmetric"}, fc=0.3, sigma2=0.02, fc_negative=0.2, sigma2_negative=0.01
    )
    found = table.tabulated(Job(model, "x"))
    export = table.write(Job(model, "x"))
    assert table.model_of(export.files["x.csv"]).parameters == found.model.parameters
    assert export.notes == ()
    points = table.read(export.files["x.csv"])
    moving = points.velocity != 0.0
    expected = [model.law.steady(v, model.parameters) for v in points.velocity[moving]]
    np.testing.assert_allclose(points.torque[moving], expected, rtol=1e-12)


@settings(max_examples=25)
@given(fc=st.floats(1e-3, 1e3), rise=st.floats(1.0, 3.0), vs=st.floats(1e-3, 10.0), points=st.integers(2, 40))
def test_every_table_comes_back(fc, rise, vs, points):
    model = Model("stribeck_plain", fs=rise * fc, fc=fc, vs=vs)
    job = Job(model, "x", nearest=True, settings={"points": points})
    text = table.write(job).files["x.csv"]
    assert len(text.splitlines()) <= points + 1
    assert table.model_of(text).parameters == table.tabulated(job).model.parameters


def test_a_fine_table_counts_as_the_curve_and_a_coarse_one_does_not():
    assert "off the sliding curve" in table.write(Job(STRIBECK, "x")).notes[0]
    with pytest.raises(CannotCarry, match="shape of its sliding curve"):
        table.write(Job(STRIBECK, "x", settings={"points": 2}))


@pytest.mark.parametrize(
    ("text", "says"),
    [("", "first line"), ("a,b\n", "first line"), (f"{table.HEADER}\n0,1\n", "three numbers"),
     (f"{table.HEADER}\n0,1,1\n0,1,1\n", "sort"), (f"{table.HEADER}\n1,1,1\n", "torque at 0")],
)  # fmt: skip
def test_a_damaged_table_is_named(text, says):
    with pytest.raises(InputError, match=says):
        table.read(text)


# ---- the kernel's list -----------------------------------------------------------------------------------------


@settings(max_examples=25)
@given(
    fc=st.floats(1e-2, 1e2), rise=st.floats(1.0, 2.0), vs=st.floats(1e-3, 10.0), unit=st.floats(1e-4, 1.0),
    motion=st.sampled_from(["rotary", "linear"]),
)  # fmt: skip
@example(
    fc=0.03125, rise=1.0, vs=0.5, unit=1.0, motion="rotary"
)  # 188 steps of the list's finest are its largest torque
def test_the_kernels_rules_hold_for_any_curve(fc, rise, vs, unit, motion):
    model = Model("stribeck_plain", fs=rise * fc, fc=fc, vs=vs, sigma2=0.1 * fc)
    text = list_of(model, nearest=True, torque_per_unit=unit, motion=motion)
    got = entries(text)
    count = int(got["frict_comp.table_entries"])
    speeds = [got[f"frict_comp.table[{i}].in"] for i in range(count)]
    torques = [got[f"frict_comp.table[{i}].out"] for i in range(count)]
    assert got["frict_comp.mode"] == 3
    assert 2 <= count <= 20
    assert f"frict_comp.table[{count}].in" not in got
    assert speeds[0] == torques[0] == 0.0
    assert all(a < b for a, b in itertools.pairwise(speeds))
    assert all(x == int(x) and abs(x) < 2**31 for x in speeds + torques)
    assert -(2**15) < got["frict_comp.scaling_factor"] < 2**15
    # In the units of the documentation: thousandths of a degree (micrometres) per second, scaling in per mille.
    top = speeds[-1] * (1e-6 if motion == "linear" else math.radians(1e-3))
    assert top == pytest.approx(100.0 * vs, rel=1e-3)
    # Whole numbers of this torque: rounded to the nearest, and four digits of it unless the factor is its smallest.
    one = unit * got["frict_comp.scaling_factor"] / 1000.0
    wanted = model.law.steady(top, model.parameters)
    assert abs(torques[-1] * one - wanted) <= 0.5 * one + 1e-6 * wanted
    assert got["frict_comp.scaling_factor"] == 1.0 or max(map(abs, torques)) >= 0.99e4
    back = beckhoff.read(text, unit, motion)
    job = Job(model, "x", nearest=True, settings={"torque_per_unit": unit, "motion": motion})
    assert back.parameters.velocity == beckhoff.listed(job)[0].model.parameters.velocity
    assert back.parameters.forward == pytest.approx(
        beckhoff.listed(job)[0].model.parameters.forward, rel=1e-12
    )
    # What the export says of its error holds between the points too, rounding and all.
    assert beckhoff.check(job, beckhoff.write(job)).passed


def test_the_way_over_which_the_current_is_built_up_is_that_of_the_contact():
    got = entries(list_of(LUGRE, nearest=True))
    assert got["frict_comp.position_delay"] == round(math.degrees(0.335 / 3.5e4) * 1e4)  # 5 of 0.0001 degrees
    assert entries(list_of(STRIBECK))["frict_comp.position_delay"] == 0.0
    soft = Model("dahl", sigma0=1.0, fc=0.285)
    assert entries(list_of(soft, nearest=True))["frict_comp.position_delay"] == 10.0  # the kernel's largest
    values = {"position_delay": "3", "reversal_lookahead": "4", "delay_cycles": 9}
    got = entries(list_of(STRIBECK, **values))
    assert [got[f"frict_comp.{name}"] for name in values] == [3.0, 4.0, 9.0]


@pytest.mark.parametrize(
    ("values", "says"),
    [({"position_delay": "11"}, "0 and 10"), ({"position_delay": "x"}, "whole number"), ({"motion": "odd"}, "rotary"),
     ({"reversal_lookahead": "5"}, "0 to 4"), ({"torque_per_unit": "0"}, "torque_per_unit")],
)  # fmt: skip
def test_what_the_kernel_does_not_take_is_refused(values, says):
    with pytest.raises(InputError, match=says):
        list_of(STRIBECK, **values)


def test_the_drives_unit_must_be_given():
    with pytest.raises(InputError, match=r"settings=..torque_per_unit.: VALUE"):
        beckhoff.write(Job(STRIBECK, "x"))


@pytest.mark.parametrize(
    ("change", "says"),
    [(("table[1].in  ", "table[99].in "), "no frict_comp.table.1..in"), (("entries        20", "entries 21"), "21"),
     (("mode                 3", "mode x"), "must be a finite number"),
     (("entries        20", "entries inf"), "must be a finite number"), (("entries        20", "entries 2.5"), "2.5"),
     (("entries        20", "entries nan"), "must be a finite number")],
)  # fmt: skip
def test_a_damaged_list_is_named(change, says):
    text = list_of(STRIBECK)
    assert change[0] in text
    with pytest.raises(InputError, match=says):
        beckhoff.read(text.replace(*change), 2.4e-3)


@pytest.mark.parametrize(
    ("arguments", "says"), [((float("nan"),), "torque_per_unit"), ((1e-3, "spiral"), "motion 'spiral'")]
)
def test_what_a_list_is_read_with_is_checked(arguments, says):
    with pytest.raises(InputError, match=says):
        beckhoff.read(list_of(STRIBECK), *arguments)
