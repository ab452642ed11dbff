"""The Modelica functions are read by the language's grammar and give the law's torque; the axis stops and starts."""

import functools
import math
from pathlib import Path

import numpy as np
import pytest

from stickslip.core.spec import Surroundings
from stickslip.exports import modelica
from stickslip.exports.golden import PACE, golden_around
from stickslip.exports.job import Job
from stickslip.models import plugins
from stickslip.models.model import Model
from support.laws import farthest, label, registered
from support.modelica_text import Package

HARD = plugins.law(str(Path(__file__).parents[1] / "support" / "hard_names.py"))
LAWS = [HARD, *registered(), *(farthest(law) for law in registered() if law.choices)]
BOUND = 1e-11
"""Of the largest torque: Modelica has no expm1."""


@functools.cache
def written(law):
    """The package of a law's example, for all tests that read it."""
    return modelica.write(Job(Model(law, **dict(law.example)), "x")).files["x.mo"]


@pytest.mark.parametrize("law", LAWS, ids=label)
def test_the_functions_give_the_torque_of_the_law(law):
    model = Model(law, **dict(law.example))
    package = Package(written(law))
    names = package.functions["step"][0]
    v = {
        "p": package.record("Parameters"),
        "u": package.record("Surroundings"),
        "z_in": package.record("State") if "State" in package.records else {},
    }
    v["z"] = v["z_in"]
    assert v["p"] == {
        k: list(x) if isinstance(x, tuple) else x for k, x in model.parameters._asdict().items()
    }
    vectors = golden_around(model, PACE, count=30, seed=3)
    word = dict(zip(Surroundings._fields, v["u"]))
    errors = []
    for v0, v1, dt, x, torque, *around in zip(*vectors):
        v |= {"v0": float(v0), "v1": float(v1), "dt": float(dt), "dt_": float(dt)}
        for name, value in zip(("position", "load", "temperature", "time"), (x, *around)):
            v["u"][word[name]] = float(value)
        got, *after = package.call("step", [v[n] for n in names])
        if after:
            v["z_in"] = v["z"] = after[0]
        errors.append(abs(got - torque))
    assert max(errors) <= BOUND * abs(vectors.torque).max()


def test_names_that_the_language_reserves_are_changed():
    text = modelica.write(Job(Model("coulomb", fc=0.3), "x")).files["x.mo"]
    assert "Real time_(start = 0.0, fixed = true);" in text
    assert "u.time_ := time;" in text


@pytest.mark.parametrize("law", registered(), ids=label)
def test_only_laws_that_jump_at_rest_come_as_an_axis_with_events(law):
    text = written(law)
    assert ("model Axis" in text) == (law.holding is not None and not law.state_fields)
    assert "model Contact" in text
    assert text.rstrip().endswith("end x;")


@pytest.mark.parametrize("law", LAWS, ids=label)
def test_the_whole_package_is_modelica(law):
    parser = pytest.importorskip("pymoca.parser")
    assert parser.parse(written(law)) is not None


def assigned(statement):
    """Names that a statement of an algorithm, or one inside it, assigns."""
    for target in getattr(statement, "left", []):
        yield ".".join(map(str, target.to_tuple()))
    for block in getattr(statement, "blocks", []):
        for inner in block:
            yield from assigned(inner)


def determined(text, name):
    """How often an equation, a binding or the algorithm determines each unknown of a flat model."""
    tree, ast = pytest.importorskip("pymoca.tree"), pytest.importorskip("pymoca.ast")
    parsed = pytest.importorskip("pymoca.parser").parse(text)
    flat = tree.flatten(parsed, ast.ComponentRef.from_string(name)).classes[name]
    times = {n: 0 for n, s in flat.symbols.items() if not {"parameter", "constant"} & set(s.prefixes)}
    for equation in flat.equations:
        times[equation.left.name] += 1
    for target in {t for statement in flat.statements for t in assigned(statement)}:
        for n in times:
            times[n] += n == target or n.startswith(f"{target}.")
    # An input without a binding is determined from outside.
    inputs = {n for n, s in flat.symbols.items() if "input" in s.prefixes}
    return {n: times[n] + (n in inputs and times[n] == 0) for n in times}


@pytest.mark.parametrize("law", LAWS, ids=label)
def test_every_unknown_of_the_contact_is_determined_once(law):
    times = determined(written(law), "x.Contact")
    assert "torque" in times
    assert set(times.values()) == {1}, {n: k for n, k in times.items() if k != 1}


@pytest.mark.parametrize("law", [HARD, registered()[0]], ids=label)
def test_an_unknown_of_the_contact_that_is_determined_twice_is_seen(law):
    bound = written(law).replace("Real applied(start = 0.0, fixed = true);", "Real applied = 0.0;")
    assert determined(bound, "x.Contact")["u.applied"] == 2


@pytest.mark.parametrize("law", ["coulomb", "viscous", "stribeck"])
def test_a_contact_is_translated_and_gives_the_torque_of_the_law(law, tmp_path):
    rumoca = pytest.importorskip("rumoca")
    model = Model(law, **registered_law(law).example)
    text = modelica.write(Job(model, "x")).files["x.mo"]
    trial = (
        "model Trial\n  x.Contact contact;\nequation\n  contact.velocity = 0.1*cos(6.0*time);\nend Trial;\n"
    )
    (tmp_path / "trial.mo").write_text(text + trial)
    translated = rumoca.Session().load(str(tmp_path / "trial.mo"), model="Trial")
    assert translated.structure().is_balanced
    result = translated.simulate(t=(0.0, 0.3), dt=0.1)
    found = dict(zip(result.names, result.to_numpy()))
    speed, torque = found["contact.velocity"], found["contact.torque"]
    # It holds the torque of the last sample, or at an event that of the one before.
    period, time = 1e-3, np.asarray(result.time)
    held = [
        [
            model.law.steady(0.1 * math.cos(6.0 * max(k - late, 0) * period), model.parameters)
            for late in (0, 1)
        ]
        for k in np.floor(time / period + 1e-6).astype(int).tolist()
    ]
    assert np.abs(torque[:, None] - held).min(axis=1).max() < 1e-6
    assert torque[0] == model.law.steady(speed[0], model.parameters)
    assert torque[-1] < 0.0 < torque[0]


@pytest.mark.parametrize("law", ["coulomb", "static", "stribeck_plain", "karnopp"])
def test_the_axis_holds_and_slides_as_the_law_does_and_a_wrong_one_is_seen(law):
    pytest.importorskip("rumoca")
    right = Job(Model(law, **dict(registered_law(law).example)), "x")
    wrong = Job(Model(law, **{k: 1.05 * v for k, v in registered_law(law).example.items()}), "x")
    assert modelica.check(right, modelica.write(right)).passed
    assert not modelica.check(right, modelica.write(wrong)).passed


def registered_law(name):
    return next(law for law in registered() if law.name == name)
