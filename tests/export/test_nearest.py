"""What a poorer target can hold of a law: exact where the law is of its kind, else the nearest with its residual."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.core.errors import InputError
from stickslip.exports import target_named
from stickslip.exports.job import CannotCarry, Job
from stickslip.exports.nearest import COULOMB, STATIC, STRIBECK, Curve, carried, nearest
from stickslip.models.model import Model
from stickslip.verbs.export import export as export_verb
from support.laws import farthest, label, registered

FORMS = (COULOMB, STATIC, STRIBECK)
TABLE_4 = {"sigma0": 3.5e4, "sigma1": 0.1, "sigma2": 0.018, "fs": 0.335, "fc": 0.285, "vs": 0.01}
MEMORYLESS = ("coulomb", "viscous", "static", "stribeck_plain", "stribeck", "karnopp")

positive = st.floats(1e-3, 1e3)


@settings(max_examples=30)
@given(fc=positive, rise=st.floats(1.0, 3.0), vs=positive, sigma2=positive)
def test_a_law_of_the_forms_own_kind_is_carried_as_it_is(fc, rise, vs, sigma2):
    for form, values in (
        (COULOMB, {"fc": fc, "sigma2": sigma2}),
        (STATIC, {"fs": rise * fc, "fc": fc, "sigma2": sigma2}),
        (STRIBECK, {"fs": rise * fc, "fc": fc, "vs": vs, "sigma2": sigma2}),
    ):
        model = Model(form.law, **values)
        found = nearest(Curve.of(model), form)
        assert found.lost == ()
        assert found.model.parameters == model.parameters
        assert found.residual == 0.0


@pytest.mark.parametrize("law", [*registered(), *map(farthest, registered())], ids=label)
def test_the_residual_bounds_the_sliding_curve_and_what_is_lost_is_named(law):
    model = Model(law, **dict(law.example))
    curve = Curve.of(model)
    lost = []
    for form in FORMS:
        found = nearest(curve, form)
        if found is None:
            continue
        lost.append(found.lost)
        other = Curve(found.model, curve.top)
        draw = np.random.default_rng(1).uniform(max(curve.slowest * 1.1, 1e-3 * curve.top), curve.top, 40)
        for v in (*draw, *-draw):
            assert abs(other.torque(v) - curve.torque(v)) <= found.residual * 1.01 + 1e-9 * curve.size
        assert found.rms <= found.residual * (1.0 + 1e-9)
    for each in lost:
        assert any("pre-sliding" in words for words in each) == bool(law.state_fields)
        for name in ("position", "load", "temperature", "time"):
            there = law.chosen.get(f"{name}_dependence", "none") != "none"
            assert any(name in words for words in each if words.startswith("its ")) == there
    if law.name in MEMORYLESS and not law.chosen:
        creeps = law.name in ("stribeck", "karnopp")  # or takes slow motion for rest
        assert all(lost) == creeps


def test_unequal_directions_are_lost_and_meet_in_the_middle():
    model = Model(
        "coulomb", {"symmetry": "asymmetric"}, fc=0.3, sigma2=0.02, fc_negative=0.2, sigma2_negative=0.02
    )
    found = nearest(Curve.of(model), COULOMB)
    assert "the difference between the directions" in found.lost
    assert found.model.parameters.fc == pytest.approx(0.25)
    assert found.residual == pytest.approx(0.05)


def test_coulomb_friction_nearest_to_a_stribeck_curve_is_that_of_least_squares():
    """At speeds far above the Stribeck velocity the bend hardly counts; the residual is the Stribeck rise."""
    found = nearest(Curve.of(Model("lugre", **TABLE_4), top=50.0), COULOMB)
    assert found.model.parameters.fc == pytest.approx(0.285, rel=1e-3)
    assert found.model.parameters.sigma2 == pytest.approx(0.018, rel=1e-3)
    assert found.residual == pytest.approx(0.05, rel=1e-2)
    assert found.at == 0.0
    v = np.linspace(0.0, 50.0, 100_001)[1:]
    bend = 0.285 + 0.05 * np.exp(-((v / 0.01) ** 2)) + 0.018 * v
    best = np.linalg.lstsq(np.stack([np.ones_like(v), v], axis=1), bend, rcond=None)[0]
    assert math.sqrt(np.mean((best[0] + best[1] * v - bend) ** 2)) <= found.rms * 1.01 + 1e-5


def test_a_refusal_says_what_is_lost_and_how_near_one_comes():
    job = Job(
        Model("gms", k=[1e4, 7e3], alpha=[0.5, 0.5], c=24.0, **{k: TABLE_4[k] for k in ("fs", "fc", "vs")}),
        "x",
    )
    with pytest.raises(
        CannotCarry, match=r"non-local memory.*nearest is fc = .* N·m .*rms.*nearest=True"
    ) as refused:
        carried(job, "urdf", [COULOMB])
    assert "\n" not in str(refused.value)


def test_the_simplest_form_that_loses_nothing_is_taken():
    model = Model("static", fs=0.3, fc=0.3, sigma2=0.1)
    assert carried(Job(model, "x"), "target", [COULOMB, STATIC]).form is COULOMB
    model = Model("static", fs=0.4, fc=0.3, sigma2=0.1)
    assert carried(Job(model, "x"), "target", [COULOMB, STATIC]).form is STATIC


def test_the_top_speed_is_the_users():
    model = Model("lugre", **TABLE_4)
    slow = carried(Job(model, "x", nearest=True, top_speed=0.002), "urdf", [COULOMB])
    assert slow.top == 0.002
    assert slow.model.parameters.fc == pytest.approx(0.335, rel=1e-2)
    with pytest.raises(InputError, match="top speed"):
        Job(model, "x", top_speed=0.0)


def test_settings_are_asked_for_by_name():
    urdf = target_named("urdf")
    model = Model("coulomb", fc=0.3, sigma2=0.0)
    assert 'name="elbow"' in urdf.write(Job(model, "x", settings={"joint": "elbow"})).files["x.urdf"]
    with pytest.raises(InputError, match="joint"):
        urdf.write(Job(model, "x", settings={"joints": "elbow"}))


def test_an_identified_model_is_compared_up_to_the_fastest_recorded(tmp_path):
    """A curve up to 100 times the velocity over which its law changes says nothing of an axis that is faster."""
    file = tmp_path / "model.toml"
    file.write_text(
        'law = "stribeck"\n[parameters]\nk = 50.0\nfs = 0.4\nfc = 0.3\nvs = 0.01\nsigma2 = 0.02\n'
        "[speeds]\npositive = [0.01, 0.5, 30.0]\nnegative = [-0.02, -1.0, -40.0]\n"
    )
    with pytest.raises(CannotCarry, match=r"from 0 to 40 rad/s; top_speed gives another"):
        export_verb(file, "mujoco", settings={"inertia": 1e-3})
    with pytest.raises(CannotCarry, match=r"from 0 to 2 rad/s"):
        export_verb(file, "mujoco", settings={"inertia": 1e-3}, top_speed=2.0)
