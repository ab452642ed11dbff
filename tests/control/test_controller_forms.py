"""One controller, however it was given: by gains and a compensator, by control laws, or by both."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

import stickslip as ss
from stickslip.control.files import Placement, composed
from stickslip.control.written import tables_of
from stickslip.core.config import Document, Table
from stickslip.core.errors import ParameterError
from stickslip.core.spec import Surroundings
from stickslip.simulation.compiled_controller import COMPENSATION, compiled, replay

TIME, INERTIA = 1e-3, 3.8623e-4
PD = ss.place("PD", INERTIA, 20.0, 1.0)
LUGRE = ss.load_machine("thesis-dry").models["lugre"]
OBSERVER = ss.ControlBlock("disturbance_observer", inertia=INERTIA, corner=300.0)
FORWARD = ss.Feedforward(LUGRE, 0.9, lead=1e-3, offset=0.01, inertia_feedforward=INERTIA)


def torques(controller):
    """Along a noisy motion, compiled."""
    t = TIME * np.arange(400)
    motion = np.column_stack([0.3 * np.sin(9.0 * t), 2.7 * np.cos(9.0 * t), -24.3 * np.sin(9.0 * t)])
    seen = motion[:, 0] + 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    out, more = np.zeros(len(t)), np.zeros(len(t))
    inputs = np.ascontiguousarray(np.column_stack([seen, motion]))
    replay(compiled(controller), inputs, np.array(Surroundings()), COMPENSATION, out, more)
    return out


@pytest.mark.parametrize("beside", [None, OBSERVER], ids=["short", "with an observer"])
def test_the_short_form_is_its_laws_bit_for_bit(beside):
    """Also beside a law that is given at its place, through a filter, and read back from a file."""
    short = ss.Controller(PD, FORWARD, 0.6, TIME, 4096.0, 80.0, observer=beside)
    laws = short.with_blocks(short.blocks.values())
    assert short.is_short is (beside is None)
    assert (laws.gains, laws.compensator, laws.velocity_filter) == (None, None, 0.0)
    assert list(laws.blocks) == list(short.blocks)
    assert laws.values() == short.values()
    assert np.array_equal(torques(laws), torques(short))
    tables = tables_of(short)
    known = {"feedforward": LUGRE}
    read = composed(
        Table(tables["controller"], Document("x", None), ("controller",)), INERTIA, None, known, {}
    )
    assert np.array_equal(torques(read), torques(short))


def test_gains_may_stand_beside_laws_in_a_file():
    table = {
        "linear": "PD", "sample_time": TIME, "torque_limit": 0.6,
        "compensator": "feedforward", "law": "lugre", "gain": 0.9,
        "observer": {"law": "disturbance_observer", "corner": 300.0},
    }  # fmt: skip
    poles = Placement(20.0, 1.0)
    read = composed(Table(table, Document("x", None), ("controller",)), INERTIA, poles, {"lugre": LUGRE}, {})
    written = ss.Controller(PD, ss.Feedforward(LUGRE, 0.9), 0.6, TIME, observer=OBSERVER)
    assert read.gains == PD
    assert list(read.blocks) == ["estimator", "feedforward", "observer", "loop"]
    assert read.values() == written.values()
    assert np.array_equal(torques(read), torques(written))


def test_a_controller_keeps_what_it_was_given():
    """Equality, hashing and what is sent to another process are of that, not of what was found of it."""
    one, other = (ss.Controller(PD, FORWARD, 0.6, TIME) for _ in range(2))
    assert one.blocks  # found, and kept
    assert one == other
    assert hash(one) == hash(other)
    assert one != replace(one, gains=PD._replace(kp=1.0))
    assert replace(one, gains=PD._replace(kp=1.0)).values()["loop_kp"] == 1.0
    assert replace(one, observer=OBSERVER).observer == (OBSERVER,)
    bare = ss.Controller(PD, sample_time=TIME)
    assert bare.functions
    assert pickle.loads(pickle.dumps(bare)) == bare


def test_numbers_have_short_names_in_the_short_form_alone():
    short = ss.Controller(PD, FORWARD, 0.6, TIME)
    both = replace(short, observer=OBSERVER)
    assert short.numbers() == PD._asdict()
    assert both.numbers() == both.values()
    assert both.numbers()["observer_corner"] == 300.0
    assert short.with_numbers({"kp": 2.0}).gains == PD._replace(kp=2.0)
    changed = both.with_numbers({"loop_kp": 2.0, "feedforward_gain": 0.5})
    assert (changed.values()["loop_kp"], changed.values()["feedforward_gain"]) == (2.0, 0.5)
    assert set(short.described()) == {"gains", "compensator", "reference_velocity"}
    assert set(both.described()["controller"]) >= {*both.blocks, "sample_time"}


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"gains": PD, "loop": ss.ControlBlock("pd", kp=1.0, kd=0.1)}, "gains and loop exclude each other"),
        (
            {"gains": PD, "velocity_filter": 50.0, "estimator": ss.ControlBlock("backward_difference")},
            "velocity_filter and estimator exclude each other",
        ),
        ({"gains": ss.ControlBlock("pd", kp=1.0, kd=0.1)}, "a control law is given by its place"),
        ({"gains": PD, "compensator": 1e-3}, r"must be Feedforward\(\.\.\.\) or Feedback"),
        ({}, "no control law"),
        ({"gains": PD, "observer": ss.ControlBlock("adaptive_gms", **ss.control_law("adaptive_gms").example)},
         "adaptive_gms cannot adapt while the axis sticks"),
    ],
)  # fmt: skip
def test_what_does_not_go_together_is_refused(given, said):
    with pytest.raises(ParameterError, match=said):
        ss.Controller(**{"sample_time": TIME, **given})
