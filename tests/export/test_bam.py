"""BAM: files are read back as written, and hold the budget of the published equation."""

import json
import math

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from stickslip.core.errors import InputError
from stickslip.exports import bam
from stickslip.exports.job import CannotCarry, Job
from stickslip.models.model import Model

positive = st.floats(1e-6, 1e6)
XL330 = {  # M6 of the published set, bam/params/xl330/m6.json
    "kt": 0.286386, "R": 2.000017, "armature": 0.00256977, "friction_base": 0.0023258418670152347,
    "friction_stribeck": 0.0001856264715700908, "load_friction_motor": 0.23063000784446322,
    "load_friction_external": 0.26077932692372613, "load_friction_motor_stribeck": 1.9157733081388423e-06,
    "load_friction_external_stribeck": 0.15158776983752117, "load_friction_motor_quad": 0.005595958708218643,
    "load_friction_external_quad": 0.0037747149629857673, "dtheta_stribeck": 0.11532863880939243,
    "alpha": 1.000022697315946, "friction_viscous": 0.0185448141303962, "model": "m6", "actuator": "xl330",
}  # fmt: skip


def text_of(model, nearest=False, **values):
    return bam.write(Job(model, "axis", nearest=nearest, settings=values)).files["axis.json"]


@settings(max_examples=50)
@given(fc=positive, rise=st.floats(1.0, 2.0), vs=positive, delta_s=st.floats(0.1, 20.0), sigma2=positive)
def test_the_way_there_and_back_changes_nothing(fc, rise, vs, delta_s, sigma2):
    for model, variant in (
        (Model("coulomb", fc=fc, sigma2=sigma2), "m1"),
        (
            Model("stribeck_plain", fs=rise * fc + 1e-9 * fc, fc=fc, vs=vs, delta_s=delta_s, sigma2=sigma2),
            "m2",
        ),
    ):
        back = bam.read(text_of(model))
        assert (
            back.model.law is model.law or variant == "m2"
        )  # a bend too small to matter is Coulomb friction
        if back.variant == variant:
            assert back.model.parameters == model.parameters
        assert back.loads == {}


@pytest.mark.parametrize(
    ("law", "motor", "external", "variant"),
    [("coulomb", 0.5, 0.5, "m3"), ("stribeck_plain", 0.5, 0.5, "m4"), ("stribeck_plain", 0.5, 0.25, "m5")],
)
def test_friction_that_grows_with_the_load_keeps_its_terms(law, motor, external, variant):
    values = {"fc": 0.25} if law == "coulomb" else {"fc": 0.25, "fs": 0.375, "vs": 0.1}
    model = Model(law, **values)
    text = text_of(model, load_motor=motor, load_external=external)
    back = bam.read(text)
    assert back.variant == variant
    assert back.model.parameters == model.parameters
    content = json.loads(text)
    if variant == "m5":
        assert back.loads["load_friction_external"] == 0.25 * external
        assert back.loads["load_friction_motor_stribeck"] == 0.125 * motor
    else:
        assert back.loads["load_friction_base"] == 0.25 * motor
    # At 0.1 rad/s, motor 1 N·m, from outside -0.5 N·m: both meet in the gearing.
    bend, share = math.exp(-1.0), 1.0 + motor * 1.0 + external * 0.5
    own = (0.25 if law == "coulomb" else 0.25 + 0.125 * bend) * share
    assert bam.budget(content, 0.1, 1.0, -0.5) == pytest.approx(own, rel=1e-12)


def test_viscous_friction_that_grows_with_the_load_is_lost():
    model = Model("coulomb", fc=0.25, sigma2=0.1)
    with pytest.raises(CannotCarry, match="viscous part with the load"):
        text_of(model, load_motor=0.5)
    assert json.loads(text_of(model, nearest=True, load_motor=0.5))["model"] == "m5"


def test_a_variant_may_be_asked_for_where_it_holds_the_law():
    model = Model("coulomb", fc=0.25, sigma2=0.1)
    assert bam.read(text_of(model, variant="m6")).loads["load_friction_motor_quad"] == 0.0
    with pytest.raises(CannotCarry, match=r"leave settings=..variant.: .m2.. out"):
        text_of(Model("coulomb", fc=0.25), variant="m2", load_motor=0.5)
    with pytest.raises(InputError, match="m7"):
        text_of(model, variant="m7")


def test_a_published_file_is_read():
    back = bam.read(json.dumps(XL330))
    p = back.model.parameters
    assert (back.variant, back.actuator) == ("m6", "xl330")
    assert p.fc == XL330["friction_base"]
    assert p.fs - p.fc == pytest.approx(XL330["friction_stribeck"], rel=1e-9)
    assert p.vs == XL330["dtheta_stribeck"]
    assert back.loads["load_friction_external_quad"] == XL330["load_friction_external_quad"]


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("{", "no BAM file"),
        ("[]", "m1 to m6"),
        ('{"model": "m9"}', "m1 to m6"),
        ('{"model": ["m1"]}', "m1 to m6"),
        (["m1"], "no BAM file"),
        ("[" * 100_000, "no BAM file"),
        ('{"model": "m1", "friction_base": NaN, "friction_viscous": 0.0}', "friction_base"),
        (f'{{"model": "m1", "friction_base": 1{"0" * 400}, "friction_viscous": 0.0}}', "friction_base"),
        (
            '{"model": "m3", "friction_base": 1, "friction_viscous": 0, "load_friction_base": Infinity}',
            "load_f",
        ),
        ('{"model": "m1", "friction_base": "0.1"}', "friction_base"),
        ('{"model": "m1", "friction_base": -0.1, "friction_viscous": 0.0}', "fc = -0.1"),
        ('{"model": "m2", "friction_base": 0.1, "friction_viscous": 0.0}', "friction_stribeck"),
    ],
)
def test_a_damaged_file_is_named(text, says):
    with pytest.raises(InputError, match=says):
        bam.read(text)
