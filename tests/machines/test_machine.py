"""Machines and their files: the thesis's numbers, what can be switched off, and complaints."""

from __future__ import annotations

import warnings
from pathlib import Path

import numpy as np
import pytest

import stickslip as ss
from stickslip.analyse.flexibility import lowest_first_mode
from stickslip.cli import main
from stickslip.core.errors import ConfigError, ModelRemark, ParameterError, UnknownName
from stickslip.machines.files import library, machine
from stickslip.machines.flexible import FlexibleAxis
from stickslip.machines.machine import IMPERFECTIONS
from stickslip.machines.motor import Harmonics

LIBRARY = Path(__file__).parents[2] / "src" / "stickslip" / "machines" / "library"


def breakaway(m):
    """The printed break-away torque: s(0)."""
    p = m.contact.friction.parameters
    return p.fs if hasattr(p, "fs") else p.beta0 + p.beta1


@pytest.mark.parametrize(
    ("name", "shaft", "coupling"), [("thesis-dry", 7.46e-4, 1.7e-5), ("thesis-grease", 6.85e-4, 1.5e-5)]
)
def test_static_twist_of_section_4_5(name, shaft, coupling):
    m = machine(name)
    twists = m.flexible.twist(breakaway(m))
    assert twists[0] == pytest.approx(coupling, rel=0.03)  # two digits are printed
    assert twists[1] == pytest.approx(shaft, rel=1.5e-3)  # three


@pytest.mark.parametrize("name", ["thesis-dry", "thesis-grease"])
def test_modes_and_their_discrepancy(name):
    m = machine(name)
    assert m.inertia == 4.2757e-4
    zero, first, second = m.flexible.modes
    assert zero == 0.0
    assert second == pytest.approx(2750.0, rel=1e-3)
    assert 303.0 < first < 310.0  # the thesis prints 270, which no division of J gives


def test_the_modes_are_those_of_the_matrices():
    axis = FlexibleAxis(1.2e-4, 1.2e-4, 1.8757e-4, 17800.0, 396.0)
    k = np.array([[17800, -17800, 0], [-17800, 18196, -396], [0, -396, 396.0]])
    m = np.diag([1.2e-4, 1.2e-4, 1.8757e-4])
    found = np.sqrt(np.abs(np.sort(np.linalg.eigvals(np.linalg.solve(m, k)).real))) / (2 * np.pi)
    assert np.allclose(axis.modes[1:], found[1:], rtol=1e-9)


def test_no_division_of_the_inertia_has_a_lower_first_mode():
    least = lowest_first_mode((17800.0, 396.0), 4.2757e-4)
    assert least == pytest.approx(303.0, abs=0.5)
    rng = np.random.default_rng(0)
    for share in rng.dirichlet((1.0, 1.0, 1.0), 500):
        if share.min() > 1e-3:
            a, b, c = (4.2757e-4 * s for s in share)
            assert FlexibleAxis(a, b, c, 17800.0, 396.0).modes[1] >= least


@pytest.mark.parametrize(("name", "seen"), [("thesis-dry", 388.0), ("thesis-grease", 390.0)])
def test_what_the_encoder_sees_of_the_contact(name, seen):
    m = machine(name).without("bearings")
    assert m.visible_stiffness == pytest.approx(seen, abs=0.3)
    rigid = m.without("flexibility")
    printed = {"thesis-dry": 240.6583 + 91.2208 + 56.2779, "thesis-grease": 315.0885 + 69.7325 + 113.2177}
    assert rigid.visible_stiffness == pytest.approx(printed[name], rel=1e-12)
    assert m.flexible.behind(seen) > 15000.0
    assert m.flexible.behind(498.0) == float("inf")


@pytest.mark.parametrize(("name", "peak"), [("thesis-dry", 0.05), ("thesis-grease", 0.07)])
def test_ripple_peak_to_peak(name, peak):
    m = machine(name).without("direction")
    level = m.clutch.law.steady(0.3, m.clutch.parameters)
    assert m.contact.ripple.peak_to_peak() * level == pytest.approx(peak, rel=0.02)


@pytest.mark.parametrize("name", ["thesis-dry", "thesis-grease"])
def test_the_bearings_part_is_taken_off_the_clutch(name):
    m = machine(name).without("direction")
    whole, clutch = m.contact.friction, m.clutch
    for v in (0.01, 0.3, 2.0):
        bearings = m.contact.bearings.coulomb + m.contact.bearings.viscous * v
        parts = clutch.law.steady(v, clutch.parameters) + bearings
        assert parts == pytest.approx(whole.law.steady(v, whole.parameters), rel=1e-9)


def test_every_imperfection_can_be_switched_off():
    m = machine("thesis-dry")
    for name in IMPERFECTIONS:
        assert m.without(name).switched_off == (name,)
    bare, ideal = m.without(*IMPERFECTIONS), machine("ideal")
    assert bare.clutch.parameters == ideal.clutch.parameters
    assert bare.encoder.counts == 0.0
    assert bare.flexible is None
    with pytest.raises(UnknownName, match="did you mean 'cogging'"):
        m.without("coging")


def test_friction_opposes_the_motion_up_to_the_declared_speed(tmp_path):
    text = (LIBRARY / "thesis-grease.toml").read_text()
    path = tmp_path / "fast.toml"
    path.write_text(text.replace("max_speed = 37.699", "max_speed = 90.0"))
    with pytest.raises(ConfigError, match="friction helps the motion at 7"):
        machine(path)


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("inertia = 4.2757e-4", "inertia = 5e-4", "make them agree"),
        ("delay = 0.0", "delay = 200", "from 0 to 100"),
        ("order = [12, 24]", "order = [12]", "give as many of each"),
        ("order = [12, 24]", 'order = "x"', "must be a list of finite numbers"),
        ("torque_constant", "torque_konstant", "torque_constant"),
        ("peak_to_peak = 0.05", "peak_to_peak = 0.0", "peak_to_peak"),
        ("coulomb = 0.02", "coulomb = -1", "coulomb"),
        ("sample_time = 1e-3", "sample_time = 0", "sample_time"),
        ('law = "gms"', 'law = "gsm"', "gms"),
    ],
)
def test_a_file_that_cannot_be_used_is_refused_in_one_line(tmp_path, old, new, says):
    path = tmp_path / "m.toml"
    text = (LIBRARY / "thesis-dry.toml").read_text()
    assert old in text
    path.write_text(text.replace(old, new, 1))
    with pytest.raises((ConfigError, UnknownName), match=says) as caught:
        machine(path)
    assert "\n" not in str(caught.value)


def test_names():
    assert {"ideal", "thesis-dry", "thesis-grease"} <= set(library())
    with pytest.raises(UnknownName, match="thesis-dry"):
        machine("thesis-dri")
    with pytest.raises(ParameterError, match="as many of each"):
        Harmonics((1.0,), (), ())


def test_a_band_of_velocities_at_rest_is_said_to_be_none_of_a_machines(tmp_path, capsys):
    values = {"dv": 1e-3, "fs": 0.335, "fc": 0.285, "vs": 0.01}
    with pytest.warns(ModelRemark, match=r"slower than 0\.001 rad/s .* rests at 0 rad/s alone"):
        ss.Machine("own", 4e-4, ss.Contact(ss.Model("karnopp", **values)))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ss.Machine("own", 4e-4, ss.Contact(ss.Model("stribeck_plain", fs=0.335, fc=0.285, vs=0.01)))
    file = tmp_path / "banded.toml"
    numbers = "".join(f"{name} = {value}\n" for name, value in values.items())
    file.write_text(f'inertia = 4e-4\n[friction]\nlaw = "karnopp"\n{numbers}')
    assert main(["machine", str(file)]) == 0
    said = capsys.readouterr().err
    assert said.startswith(f"stickslip: note: {file}: law 'karnopp' counts")
    assert said.count("\n") == 1


def test_a_delay_is_in_samples_and_one_that_looks_like_seconds_is_remarked(tmp_path):
    contact = ss.Contact(ss.Model("coulomb", fc=0.1))
    with pytest.warns(ModelRemark, match=r"2e-06 s late; is it in s\? Then it is 2 samples"):
        assert ss.Machine("m", 4e-4, contact, delay=2e-3).remark
    for delay in (0.0, 0.01, 0.5, 1.0, 2.5):
        assert not ss.Machine("m", 4e-4, contact, delay=delay).remark
    with pytest.raises(ParameterError, match=r"from 0 to 100, in samples"):
        ss.Machine("m", 4e-4, contact, delay=100.5)
    path = tmp_path / "late.toml"
    path.write_text((LIBRARY / "thesis-dry.toml").read_text().replace("delay = 0.0", "delay = 0.0002"))
    with pytest.warns(ModelRemark, match=r"delay = 0\.0002 is in samples"):
        machine(path)
