"""`stickslip law FILE.py --check`: every fault by name, and no word against laws that are right."""

from __future__ import annotations

from dataclasses import replace

import pytest

from stickslip.cli import main
from stickslip.contract import motions
from stickslip.contract.agreement import modes_against_rate, steady_is_reached, step_against_rate
from stickslip.contract.derivatives import derivatives
from stickslip.contract.description import bounds, description, subset
from stickslip.contract.energy import gives_back
from stickslip.contract.torques import unbounded
from stickslip.contract.units import parsed, units
from stickslip.contract.verdict import failed, held
from stickslip.core.spec import Bristle
from stickslip.models import plugins
from support.faulty import PRODUCT, dahl

NO_RATE = ("rate=rate, ", "")


@pytest.fixture
def law_of(tmp_path):
    """The law of a text."""

    def law(text: str):
        file = tmp_path / "law.py"
        file.write_text(text)
        return plugins.law(str(file))

    return law


def bounded(law):
    """The check of the law alone, without its options."""
    p = motions.example(law)
    wrong = unbounded(law, p, *motions.motions(motions.seeded(law, 1), 60))
    return failed("bounded", wrong) if wrong else held("bounded", "")


def dissipation(law):
    """The check of the law's example alone."""
    swings = motions.swings(motions.seeded(law, 5), 20)
    back = gives_back(law, motions.example(law), *swings)
    return failed("dissipation", "gives energy back") if back else held("dissipation", "")


DAHL = dahl()
STEADY = "return math.copysign(p.fc, v)"
GOAL = "goal = math.copysign(p.fc, distance)"
FAULTS = {
    "no title": (description, dahl(('title="Dahl"', 'title=""')), "title is missing"),
    "a unit in N·m": (units, dahl(('Par("N·m", "F_C"', 'Par("-", "F_C"')), "with every N·m four times"),
    "a torque in the file": (units, dahl((GOAL, GOAL.replace("p.fc", "p.fc + 0.05")), NO_RATE), "four times"),
    "another steady": (steady_is_reached, dahl((STEADY, STEADY.replace("p.fc", "0.9 * p.fc"))), "steady says"),
    "not mirrored": (bounded, dahl(
        ("    return goal + (z.force", "    goal = goal + 0.1 * p.fc\n    return goal + (z.force"), NO_RATE
    ), "mirrored"),
    "above its level": (bounded, dahl(
        (GOAL, GOAL.replace("p.fc", "(1.0 + abs(distance)) * p.fc")), NO_RATE
    ), "above the level"),
    "energy of nothing": (dissipation, dahl((GOAL, GOAL.replace("= ", "= -")), NO_RATE), "gives energy back"),
    "a step too short": (step_against_rate, dahl((
        "        z.force = slide(0.5 * v0 * part, z, p)", "        z.force = 0.0")), "off the rate|differ from"),
    "a parameter in steps": (derivatives, dahl((GOAL, GOAL.replace(
        "p.fc", "1e-4 * math.floor(1e4 * p.fc)")), NO_RATE), "does not follow fc"),
}  # fmt: skip


@pytest.mark.parametrize("name", FAULTS)
def test_a_fault_is_found_by_the_check_that_looks_for_it(name, law_of):
    check, text, said = FAULTS[name]
    assert check(law_of(DAHL)).passed
    verdict = check(law_of(text))
    assert verdict.passed is False, verdict.text
    assert any(part in verdict.text for part in said.split("|")), verdict.text


def test_a_right_law_with_a_source_of_its_own_and_a_level_of_products_passes(
    law_of, tmp_path, capsys, monkeypatch
):
    """None of its parameters is in N·m; the whole command, with two exports for brevity."""
    monkeypatch.setattr("stickslip.contract.EXPORTS", ("python", "urdf"))
    law_of(PRODUCT)
    assert main(["law", str(tmp_path / "law.py"), "--check"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert not [line for line in lines if line.startswith("FAILED")]
    said = {line[8:26].strip(): line for line in lines}
    assert said["bounded"].startswith("ok")
    assert "no parameter in N·m gives a level" in said["bounded"]
    assert said["export python"].startswith("ok")
    assert said["export urdf"].startswith("-       export urdf        urdf carries Coulomb")
    assert lines[-1] == "dahl-example: passed all available checks"


def test_the_command_ends_with_1_where_a_check_fails(law_of, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("stickslip.contract.CHECKS", (description, steady_is_reached))
    monkeypatch.setattr("stickslip.contract.EXPORTS", ())
    law_of(FAULTS["another steady"][1])
    assert main(["law", str(tmp_path / "law.py"), "--check"]) == 1
    out = capsys.readouterr().out
    assert "FAILED  steady" in out
    assert out.endswith("dahl-example: 1 check failed\n")
    assert main(["law", str(tmp_path / "law.py"), "--check", "--set", "fc=0.1"]) == 2
    assert "--check" in capsys.readouterr().err


@pytest.mark.parametrize("name", ["coulomb", "armstrong", "gms", "elasto_plastic", "leuven", "stribeck"])
def test_laws_of_the_package_pass(name):
    """What needs no compiler, over laws of every kind; the other checks are the other files of this folder."""
    law = plugins.law(name)
    for check in (description, subset, bounds, units, steady_is_reached):
        verdict = check(law)
        assert verdict.passed is not False, verdict


@pytest.mark.parametrize("name", ["gms", "coulomb", "lugre", "dahl", "elasto_plastic"])
def test_modes_move_an_axis_as_the_rate_does(name, law_of):
    verdict = modes_against_rate(plugins.law(name))
    assert verdict.passed, verdict
    law = plugins.law(name)
    wrong = replace(law, modes=lambda p: _stiffer(law.modes(p)), variants={}, name="wrong")
    assert modes_against_rate(wrong).passed is False


def test_a_growth_of_another_shape_is_told_from_the_steps():
    law = plugins.law("dahl")
    ductile = replace(law, example={**law.example, "delta_d": 2.0}, variants={}, name="ductile")
    assert modes_against_rate(ductile).passed
    wrong = replace(ductile, growth=lambda y, limit, p: 1.0 - y / limit, variants={}, name="wrong")
    assert modes_against_rate(wrong).passed is False
    without = replace(ductile, growth=None, variants={}, name="without")
    assert "give `growth`" in modes_against_rate(without).text


def _stiffer(elements):
    """The elements at another level, or with another spring."""
    if isinstance(elements, Bristle):
        return replace(elements, stiffness=1.2 * elements.stiffness)
    return replace(elements, share=tuple(0.9 * x for x in elements.share))


@pytest.mark.parametrize(
    ("text", "powers"),
    [
        ("N·m", (1, 1, 0, 0)), ("N·m/(rad·s)", (1, 1, -1, -1)), ("N·m·s/rad", (1, 1, -1, 1)), ("-", (0, 0, 0, 0)),
        ("kg·m²", (1, 1, 0, 2)), ("1/K", (0, 0, 0, 0)), ("rad^0.5/s^1.5", (0, 0, 0.5, -1.5)),
        ("N·m·(s/rad)^δ", None), ("lbf", None),
    ],
)  # fmt: skip
def test_units_are_read(text, powers):
    assert parsed(text) == powers
