"""What is given in a number's place and is none, is said by name, value and remedy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import stickslip as ss
from stickslip.core.errors import ParameterError
from stickslip.machines.encoder import Encoder
from stickslip.machines.motor import Amplifier

ROOT = Path(__file__).parent
DEMO = str(Path(ss.__file__).parent / "demo.csv")
LAW = ss.Model("coulomb", fc=0.3)
AXIS, GAINS = ss.RigidAxis(1e-3, LAW), ss.place("PD", 1e-3, 10.0)
LOOP, SINE = ss.Controller(GAINS), ss.Reference("sine", amplitude=0.1, frequency=1.0)
MODEL = 'law = "coulomb"\n[parameters]\nfc = 0.285\n[axis]\ninertia = 4e-4\n'

CALLS: list[tuple[str, str, Callable[..., Any]]] = [
    ("place", "inertia", lambda x: ss.place("PD", inertia=x, bandwidth=10.0)),
    ("pd", "kp", lambda x: ss.pd(x, 0.1)),
    ("coulomb", "fc", lambda x: ss.Model("coulomb", fc=x)),
    ("scaled", "fc", lambda x: LAW.scaled(fc=x)),
    ("sine", "amplitude", lambda x: ss.Reference("sine", amplitude=x, frequency=1.0)),
    ("axis", "inertia", lambda x: ss.RigidAxis(inertia=x, friction=LAW)),
    ("axis", "load", lambda x: ss.RigidAxis(1e-3, LAW, load=x)),
    ("controller", "sample_time", lambda x: ss.Controller(GAINS, sample_time=x)),
    ("controller", "torque_limit", lambda x: ss.Controller(GAINS, torque_limit=x)),
    ("Gains", "kp", lambda x: ss.Controller(ss.Gains(kp=x))),
    ("pd", "kp", lambda x: ss.ControlBlock("pd", kp=x, kd=1.0)),
    ("feedforward", "gain", lambda x: ss.Feedforward(LAW, gain=x)),
    ("encoder", "counts", Encoder),
    ("amplifier", "torque_constant", Amplifier),
    ("simulate", "duration", lambda x: ss.simulate(AXIS, LOOP, SINE, x)),
    ("simulate", "output", lambda x: ss.simulate(AXIS, LOOP, SINE, 1.0, output=x)),
    ("simulate", r"initial\[1\]", lambda x: ss.simulate(AXIS, LOOP, SINE, 1.0, initial=(0.0, x))),
    ("respond", "tolerance", lambda x: ss.respond(LAW, SINE, [0.0, 0.1], tolerance=x)),
    ("identify", "sample_time", lambda x: ss.identify(DEMO, sample_time=x)),
    ("read", "counts_per_rev", lambda x: ss.read(DEMO, counts_per_rev=x)),
    ("identify", "noise", lambda x: ss.identify(DEMO, noise=x)),
    ("identify", "harmonics", lambda x: ss.identify(DEMO, harmonics=x)),
    ("identify", r"values\['fc'\]", lambda x: ss.identify(DEMO, values={"fc": x})),
    ("export", "gain", lambda x: ss.export(LAW, "c99", compensator="ff", gain=x)),
    ("sweep", "cases", lambda x: ss.sweep(ROOT / "sweep" / "small.toml", cases=x)),
    ("compare", "top", lambda x: ss.compare("a.toml", "b.toml", top=x)),
    ("recommend", "bandwidth", lambda x: ss.recommend("a.toml", bandwidth=x)),
    ("recommend", r"loop\[.kp.\]", lambda x: ss.recommend("a.toml", loop={"kp": x})),
]  # fmt: skip


@pytest.mark.parametrize(("owner", "name", "call"), CALLS, ids=[f"{o}-{n}" for o, n, _ in CALLS])
def test_text_in_a_numbers_place_is_refused_by_name_with_the_remedy(
    owner: str, name: str, call: Callable[..., Any]
) -> None:
    with pytest.raises(
        ss.InputError, match=rf"{owner}: {name} = '0.25' must be .*; write it without quotes, 0.25"
    ):
        call("0.25")
    with pytest.raises(ss.InputError, match=rf"{owner}: {name} = 'much' must be a (whole )?number[^;]*$"):
        call("much")


@pytest.mark.parametrize("given", [None, [0.1], {}, 1j])
def test_what_is_no_text_and_no_number_is_refused_too(given: Any) -> None:
    with pytest.raises(ss.InputError, match=r"place: bandwidth = .* must be a number"):
        ss.place("PD", 1e-3, given)
    with pytest.raises(ss.InputError, match=r"controller: encoder_counts = .* must be a number"):
        ss.Controller(GAINS, sample_time=1e-3, encoder_counts=given)


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, int, Fraction])
def test_numbers_of_other_kinds_are_numbers(kind: Any) -> None:
    """NumPy's were none to a law; of single precision, they would have made a run so."""
    law, axis = ss.Model("coulomb", fc=kind(2)), ss.RigidAxis(kind(2), LAW, load=kind(1))
    assert law.parameters.fc == 2.0
    assert type(law.parameters.fc) is float
    assert isinstance(axis.inertia, (int, float))
    assert not isinstance(axis.load, np.float32)
    assert ss.place("PD", kind(2), 10.0).kp == pytest.approx(ss.place("PD", 2.0, 10.0).kp)


def test_the_first_error_is_the_wrong_number_and_not_the_missing_file(tmp_path: Path) -> None:
    model = tmp_path / "model.toml"
    model.write_text(MODEL)
    with pytest.raises(
        ss.InputError, match="recommend: axes = '6' must be a whole number; write it without quotes, 6"
    ):
        ss.recommend(model, amplitude=0.1, axes="6")


def test_a_name_in_place_of_a_list_of_names_is_not_taken_apart() -> None:
    log = {"t": [0.0, 1.0], "position": [0.0, 1.0], "torque": [0.0, 1.0]}
    with pytest.raises(ParameterError, match=r"frozen = 'fc' must be a list of names; write \['fc'\]"):
        ss.identify(**log, frozen="fc")


def test_what_is_no_model_is_said_where_it_is_given() -> None:
    with pytest.raises(ParameterError, match="feedforward: model = 'coulomb' must be a Model, such as"):
        ss.Feedforward("coulomb")
    with pytest.raises(ParameterError, match="axis: friction = 'coulomb' must be a Model, such as"):
        ss.RigidAxis(1e-3, "coulomb")


LOG: dict[str, Any] = {"t": [0.0, 1.0], "position": [0.0, 1.0], "torque": [0.0, 1.0]}
FOUND: list[tuple[Callable[..., Any], str]] = [
    (lambda: ss.identify(**LOG, law=3), "identify: law = 3 must be text, a Law or a list of these"),
    (lambda: ss.identify(**LOG, loop=5), "identify: loop = 5 must be text, a mapping of names to a number or "
     "'difference' or 'instant' or a list of these, such as {'kp': 8.0, 'kd': 0.08}"),
    (lambda: ss.identify(**LOG, loop={}), 'loop: {} names no gain; give them, such as loop={"kp": 8, "kd": 0.08}, or '
     "leave it out"),
    (lambda: ss.identify(**LOG, loop_output="foo"), "identify: loop_output = 'foo' must be 'torque', 'current' or "
     "'voltage'"),
    (lambda: ss.identify(**LOG, harmonics=1.5), "identify: harmonics = 1.5 must be a whole number"),
    (lambda: ss.read(**LOG, units="deg"), "read: units = 'deg' must be a mapping of names to text, such as "
     "{'position': 'deg', 'torque': 'mNm'}"),
    (lambda: ss.read(**LOG, units={"torque": 3}), "read: units['torque'] = 3 must be text"),
    (lambda: ss.read(**LOG, units={"position": "grad"}), 'units={"position": "grad"}: \'grad\' is a degree in German '
     "and a gradian in English; say deg, or 0.9 deg for gradians; position takes rad, deg, rev, m, mm, um, counts"),
    (lambda: ss.read(**LOG, leave_out="1:2"), "read: leave_out = '1:2' must be a list, each text or 2 whole numbers; "
     "write ['1:2']"),
    (lambda: ss.read(DEMO, map="q=foo"), "read: map = 'q=foo' must be a mapping of names to text or a list of names; "
     "write ['q=foo']"),
    (lambda: ss.read(3), "log: an int without columns of numbers is no log; give a path, a data frame, a mapping of "
     "arrays, a Record, or arrays by name (t=..., position=..., torque=...)"),
    (lambda: ss.recommend("a.toml", bandwidth=5.0, loop={"kp": 8.0}), "bandwidth=5.0 cannot be combined with loop, "
     "which sets the gains; leave one out"),
    (lambda: ss.sweep(3), "sweep: file = 3 must be a path, a Sweep or a mapping"),
    (lambda: ss.simulate(AXIS, LOOP, SINE, 1.0, initial=0.1), "simulate: initial = 0.1 must be 2 numbers, "
     "such as (0.0, 0.0), position (rad) and velocity (rad/s)"),
    (lambda: ss.simulate(AXIS, LOOP, SINE, 1.0, dt=1e-3), "unknown argument of simulate 'dt'; choose from axis, check, "
     "controller, duration, initial, integrator, metered, output, reference, slip_rule, time_step, tolerance"),
    (lambda: ss.simulate(AXIS, LOOP), "simulate: missing a required argument: 'reference'; its arguments are axis, "
     "controller, reference, duration, integrator, tolerance, time_step, slip_rule, output, initial, metered, check"),
    (lambda: LAW.sliding_torque({1.0, 2.0}), "Model.sliding_torque: velocity = {1.0, 2.0} must be a number or a list "
     "of these"),
    (lambda: replace(LAW.law, check=int), "law: check = <class 'int'> must be a function"),
    (lambda: LOOP.holding(int), "Controller.holding: change = <class 'int'> must be a function"),
    (lambda: ss.Reference.table(["a", "b"], [0.0, 1.0]), "Reference.table: time[0] = 'a' must be a number"),
]  # fmt: skip


@pytest.mark.parametrize(("call", "said"), FOUND, ids=[said[:24] for _, said in FOUND])
def test_what_users_gave_is_said_in_these_words(call: Callable[..., Any], said: str) -> None:
    with pytest.raises(ss.InputError) as error:
        call()
    assert str(error.value) == said


def test_whole_numbers_of_any_kind_are_whole_numbers() -> None:
    """2.0 for 2 is what a table of numbers gives."""
    assert ss.Feedforward(LAW, substeps=2.0).substeps == 2
    with pytest.raises(ParameterError, match=r"feedforward: substeps = 2\.5 must be a whole number"):
        ss.Feedforward(LAW, substeps=2.5)
    swept = [ss.place("PD", np.int64(1), np.float32(10.0)), ss.place("PD", 1.0, 10.0)]
    assert swept[0] == pytest.approx(swept[1])
