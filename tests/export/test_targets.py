"""One suite over every pair of law and target: it writes, says what it cannot carry, and passes its own check."""

from pathlib import Path

import pytest

from stickslip.exports import TARGETS, target_named
from stickslip.exports.job import CannotCarry, Job
from stickslip.models import plugins
from stickslip.models.model import Model
from support.laws import farthest, label, registered

ALL = {name: target_named(name) for name in TARGETS}
ODD = plugins.law(str(Path(__file__).parents[1] / "support" / "odd_names.py"))
LAWS = [ODD, *registered(), *(farthest(law) for law in registered() if law.choices)]


def job(law, target, **more):
    needed = {s.name: 4e-4 for s in target.settings if s.default is None}
    return Job(Model(law, **dict(law.example)), "friction", settings=needed, **more)


def held_to_its_check(target, order, export):
    assert any(name.lower().startswith("readme") for name in export.files)
    assert all(content for content in export.files.values())
    result = target.check(order, export) if target.check else None
    if result is None:
        return
    if result.passed is None and "not installed" not in result.text:
        return  # This law has nothing to run in this target.
    if result.passed is None:
        pytest.skip(result.text)
    assert result.passed, result.text


# Target after target for one law: what is found of its sliding curve is found once.
@pytest.mark.parametrize("target", ALL.values(), ids=lambda t: t.name)
@pytest.mark.parametrize("law", LAWS, ids=label)
def test_a_law_leaves_or_is_refused_with_what_is_lost_and_the_nearest(target, law):
    order = job(law, target)
    try:
        held_to_its_check(target, order, target.write(order))
        return
    except CannotCarry as error:
        assert target.forms
        said = str(error)
    assert said.startswith(f"{target.name} carries ")
    assert f"{law.name} would lose" in said
    assert "off the sliding curve" in said
    assert said.endswith("nearest=True")
    order = job(law, target, nearest=True)
    export = target.write(order)
    assert any(note.startswith("not carried: ") for note in export.notes)
    held_to_its_check(target, order, export)


@pytest.mark.parametrize("target", [t for t in ALL.values() if t.check], ids=lambda t: t.name)
def test_a_targets_check_fails_on_a_wrong_export(target, monkeypatch):
    law = plugins.law("coulomb") if target.name == "modelica" else ODD  # Modelica's check simulates an axis.
    right, other = job(law, target), Model(law, **{k: 1.1 * v for k, v in law.example.items()})
    export = target.write(right)
    wrong = target.write(Job(other, right.name, settings=right.settings))
    mixed = {
        **export.files,
        **{n: c for n, c in wrong.files.items() if "golden" not in n and "check" not in n},
    }
    result = target.check(right, type(export)(mixed))
    if result.passed is None:
        pytest.skip(result.text)
    assert not result.passed
