"""The Modelica functions are read by the language's grammar and give the law's torque; the axis stops and starts."""

import pytest
from modelica_text import Package

from laws import farthest, label, registered
from stickslip.export import modelica
from stickslip.export.golden import golden
from stickslip.export.job import Job
from stickslip.model import Model

LAWS = [*registered(), *(farthest(law) for law in registered() if law.choices)]
BOUND = 1e-11
"""Of the largest torque: Modelica has no expm1."""


@pytest.mark.parametrize("law", LAWS, ids=label)
def test_the_functions_give_the_torque_of_the_law(law):
    model = Model(law, **dict(law.example))
    package = Package(modelica.write(Job(model, "friction")).files["friction.mo"])
    names = package.functions["step"][0]
    v = {
        "p": package.record("Parameters"),
        "u": package.record("Surroundings"),
        "z_in": package.record("State"),
    }
    v["z"] = v["z_in"]
    assert v["p"] == {
        k: list(x) if isinstance(x, tuple) else x for k, x in model.parameters._asdict().items()
    }
    vectors = golden(model, count=30, seed=3)
    errors = []
    for v0, v1, dt, x, torque in zip(*vectors):
        v |= {"v0": float(v0), "v1": float(v1), "dt": float(dt)}
        v["u"]["position"] = float(x)
        got, *after = package.call("step", [v[n] for n in names])
        if after:
            v["z_in"] = v["z"] = after[0]
        errors.append(abs(got - torque))
    assert max(errors) <= BOUND * abs(vectors.torque).max()


def test_names_that_the_language_reserves_are_changed():
    text = modelica.write(Job(Model("coulomb", fc=0.3), "x")).files["x.mo"]
    assert "Real time_ = 0.0;" in text
    assert "u.time_ := time;" in text


@pytest.mark.parametrize("law", registered(), ids=label)
def test_only_laws_that_jump_at_rest_come_as_an_axis_with_events(law):
    text = modelica.write(Job(Model(law, **dict(law.example)), "x")).files["x.mo"]
    assert ("model Axis" in text) == (law.holding is not None and not law.state_fields)
    assert "model Contact" in text
    assert text.rstrip().endswith("end x;")


@pytest.mark.parametrize("law", LAWS, ids=label)
def test_the_whole_package_is_modelica(law):
    parser = pytest.importorskip("pymoca.parser")
    text = modelica.write(Job(Model(law, **dict(law.example)), "x")).files["x.mo"]
    assert parser.parse(text) is not None


@pytest.mark.parametrize("law", ["coulomb", "static", "stribeck_plain", "karnopp"])
def test_the_axis_holds_and_slides_as_the_law_does_and_a_wrong_one_is_seen(law):
    pytest.importorskip("rumoca")
    right = Job(Model(law, **dict(registered_law(law).example)), "x")
    wrong = Job(Model(law, **{k: 1.05 * v for k, v in registered_law(law).example.items()}), "x")
    assert modelica.check(right, modelica.write(right)).passed
    assert not modelica.check(right, modelica.write(wrong)).passed


def registered_law(name):
    return next(law for law in registered() if law.name == name)
