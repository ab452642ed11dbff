"""The attraction parameter from a velocity that swings: found where friction lags, refused where it does not."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from stickslip.commission.friction_lag import lag_of
from stickslip.commission.stiffness import with_lag
from stickslip.core.errors import InputError
from stickslip.machines.angle import AngleMap
from stickslip.machines.files import machine
from stickslip.machines.motor import Harmonics
from stickslip.models.model import Model
from stickslip.rigs.procedures.attraction import Attraction
from stickslip.rigs.procedures.base import perform
from stickslip.rigs.virtual import VirtualRig


def found_on(name, **options):
    m = machine(name)
    turned = Harmonics(m.cogging.order, m.cogging.amplitude, tuple(p + math.pi for p in m.cogging.phase))
    given = {"mean": 0.3, "swing": 0.15, "frequency": 4.0, **options}
    record = perform(Attraction(inertia=m.inertia, **given), VirtualRig(m)).record
    angle = AngleMap(m.contact.ripple, turned)
    return lag_of(record, m.inertia, angle, m.contact.friction, m.sample_time)


def test_greased_friction_lags_and_bounds_c():
    """Table 10: C = 35 N·m/s, behind a ripple twice as large as what the curve varies by."""
    found = found_on("thesis-grease")
    c = found["c"]
    assert 20.0 < c.lower < 35.0 < c.upper < 100.0
    sure = replace(found, estimates=(replace(c, identified=True, verdict=""),))
    law, said = with_lag(machine("thesis-grease").contact.friction, sure, ("the rule",))
    assert law.parameters.c == c.value
    assert said == (f"C = {c.value:.3g} N·m/s is that of the lag of friction in sliding.",)


def test_a_curve_that_is_flat_tells_nothing():
    """Table 9 at these speeds: no Stribeck effect, and the record says so (thesis 4.3.1.1.5)."""
    found = found_on("thesis-dry")
    assert not found["c"].identified
    assert (found["c"].lower, found["c"].upper) == (0.0, math.inf)
    law, said = with_lag(machine("thesis-dry").contact.friction, found, ("the rule",))
    assert law.parameters.c == 90.0
    assert "not identified" in said[1]
    assert "any value" in said[1]


def test_the_rule_gives_way_to_the_record():
    found = found_on("thesis-grease", swing=0.075)
    c = found["c"]
    assert not c.identified
    p = machine("thesis-grease").contact.friction
    values = {k: list(v) if isinstance(v, tuple) else v for k, v in p.parameters._asdict().items()}
    slow = Model(p.law, {}, **{**values, "c": 1.0})
    law, said = with_lag(slow, found, ())
    assert law.parameters.c == c.lower
    assert "lies outside" in said[0]


def test_a_motion_that_nearly_stops_is_refused():
    with pytest.raises(InputError, match="one direction"):
        found_on("thesis-dry", swing=0.28, mean=0.3)
