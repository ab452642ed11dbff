"""The map of stability against the virtual rig."""

from __future__ import annotations

import pytest

from stickslip.analyse.machine_axis import axis_of
from stickslip.analyse.presliding_loop import Drive
from stickslip.analyse.stability import stability
from stickslip.control.linear import place
from stickslip.machines.files import machine
from stickslip.report.analysis_pictures import draw_analysis
from stickslip.report.stability_pictures import picture_of_confirmed
from stickslip.studies.stability_map import confirmed

DRY = machine("thesis-dry")
PD10 = place("PD", 3.8623e-4, 10.0, 1.0)


def tried(plant, laws, filters, gains, **options):
    models = {name: plant.models[name] for name in laws}
    advice = stability(axis_of(plant), Drive(PD10), models, (0.0,)).recommended
    return confirmed(plant, PD10, models, advice, filters, gains, **options)


def test_the_rig_does_what_the_poles_say_and_bears_what_is_recommended(tmp_path):
    found = tried(DRY, ("coulomb", "gms"), (150.0, 0.0), (0.2, 0.6, 1.2))
    assert all(p.agrees for p in found.points)
    # Both kinds occur, or the agreement says nothing.
    assert {p.calm for p in found.of("gms")} == {True, False}
    assert not any(p.calm for p in found.of("coulomb"))
    assert [p.law for p in found.advised] == ["gms"]
    assert found.advised[0].calm
    text = "\n".join(found.lines())
    assert "gms       6 of 6 settings" in text
    assert "recommended gain 0.8" in text


def test_cogging_moves_an_axis_that_has_little_stiffness_left():
    """At gain 1 GMS feedback leaves 2 % of the contact: the poles are stable, but 6 mN·m of cogging are too much."""
    weak = tried(DRY, ("gms",), (10.0,), (1.0,)).points[0]
    assert weak.stable
    assert not weak.calm
    smooth = tried(DRY.without("cogging"), ("gms",), (10.0,), (1.0,)).points[0]
    assert smooth.agrees
    assert smooth.calm


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "least"), [("thesis-dry", 130), pytest.param("thesis-grease", 136, marks=pytest.mark.long)]
)
def test_the_whole_map(name, least, tmp_path):
    plant = machine(name)
    advice = stability(axis_of(plant), Drive(PD10), plant.models, (0.0,)).recommended
    found = confirmed(plant, PD10, plant.models, advice, drawn=True)
    assert sum(p.agrees for p in found.points) >= least
    assert all(p.calm for p in found.advised)
    draw_analysis(picture_of_confirmed(found), tmp_path / "map.png")
    assert (tmp_path / "map.png").stat().st_size > 20000
